#include <nanobind/stl/array.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>
#include <string>
#include <tuple>

#include "core/bindings.hpp"
#include "core/isa/dispatch.hpp"

namespace nb = nanobind;
using namespace gantry;
using Plant1 = PlantParams<double>;
using Drive1 = DriveParams<double>;
using Sim = GantrySim<double>;
using StateMap = std::map<std::string, double>;

namespace {

// Drive cycles in a time, to the nearest.
int cycles(double time_s, double cycle_s) { return static_cast<int>(std::lround(time_s / cycle_s)); }

void check_teeth(const Plant1& p) {
  if (!p.tooth_pitch) return;
  if (p.ring_teeth < 1 || p.ring_teeth > kRingTeethMax || p.pinion_teeth < 1 ||
      p.pinion_teeth > kPinionTeethMax)
    throw std::invalid_argument("single teeth: a ring of 1.." + std::to_string(kRingTeethMax) +
                                " and a pinion of 1.." + std::to_string(kPinionTeethMax) + " teeth, got " +
                                std::to_string(p.ring_teeth) + " and " + std::to_string(p.pinion_teeth));
  if (!(p.contact_ratio > 1.0 && p.contact_ratio <= 2.0))
    throw std::invalid_argument("contact_ratio must be above 1 and at most 2");
}

Sim make_sim(const Plant1& plant, const Drive1& drive, double scan_period_s, const std::string& scheme,
             int rk4_steps) {
  if (scheme != "one_evaluation" && scheme != "rk4")
    throw std::invalid_argument("scheme must be 'one_evaluation' or 'rk4', got '" + scheme + "'");
  const int per_scan = cycles(scan_period_s, drive.cycle_s);
  if (per_scan < 1 || std::fabs(per_scan * drive.cycle_s - scan_period_s) > 1e-9)
    throw std::invalid_argument("the scan period must be a whole number of drive cycles");
  check_teeth(plant);
  if (plant.second_pinion && plant.rigid)
    throw std::invalid_argument("second_pinion needs gears: rigid makes all of it one inertia");
  if (plant.lost_motor < 0 || plant.lost_motor > 2)
    throw std::invalid_argument("lost_motor must be 0 (neither), 1 or 2, got " +
                                std::to_string(plant.lost_motor));
  if (rk4_steps < 1) throw std::invalid_argument("rk4_steps must be at least 1");
  const auto native = scheme == "rk4" ? Scheme::kRungeKutta4 : Scheme::kOneEvaluation;
  return {plant,
          drive,
          static_cast<double>(cycles(drive.brake_close_s, drive.cycle_s)),
          static_cast<double>(cycles(drive.brake_open_s, drive.cycle_s)),
          {scan_period_s, drive.cycle_s, per_scan, native, rk4_steps}};
}

using ScaleTerms = std::vector<std::tuple<double, double, double>>;

LoadEncoderParams<double> make_load_encoder(double step_rad, double noise_rad, double latency_s,
                                            const ScaleTerms& scale) {
  LoadEncoderParams<double> p;
  if (scale.size() > p.scale.size()) throw std::invalid_argument("the scale has at most 4 terms");
  for (double x : {step_rad, noise_rad, latency_s})
    if (!(std::isfinite(x) && x >= 0.0))
      throw std::invalid_argument("the load encoder needs finite steps, noise and latency, none negative");
  for (std::size_t k = 0; k < scale.size(); ++k) {
    const auto [waves, amplitude, phase] = scale[k];
    if (!(std::isfinite(waves) && std::isfinite(amplitude) && std::isfinite(phase)))
      throw std::invalid_argument("the scale of the load encoder is not finite");
    p.scale[k] = {waves, amplitude, phase};
  }
  p.fitted = true;
  p.step_rad = step_rad;
  p.noise_rad = noise_rad;
  p.latency_s = latency_s;
  return p;
}

StateMap get_state(const Sim& sim) {
  StateMap m;
#define X(name, meaning) m[#name] = sim.x.name;
  GANTRY_PLANT_STATE(X)
#undef X
#define X(name, meaning) m["drive_" #name] = sim.s.name;
  GANTRY_DRIVE_STATE(X)
#undef X
  // States of effects that are off do not exist.
#define X(name, effect, meaning) \
  if (sim.plant().p.effect) m[#name] = sim.x.name;
  GANTRY_PLANT_EFFECT_STATE(X)
#undef X
  m["brake_closed"] = sim.brake.closed ? 1.0 : 0.0;
  m["brake_countdown"] = sim.brake.countdown;
  m["report_torque_mesh"] = sim.report.torque_mesh;
  m["report_vel"] = sim.report.vel;
  m["report_limited"] = sim.report.limited ? 1.0 : 0.0;
  m["count_offset"] = sim.count_offset;
  m["scans_done"] = sim.scans_done;
  // Only where the encoder is faulty: the states of sound plants keep their form.
  if (sim.encoder.spoilt) {
    m["encoder_gain"] = sim.encoder.gain;
    m["encoder_pos_start"] = sim.encoder.pos_start;
    m["encoder_seen_start"] = sim.encoder.seen_start;
  }
  return m;
}

void set_state(Sim& sim, const StateMap& m) {
  const auto value = [&m](const std::string& name) {
    const auto found = m.find(name);
    if (found == m.end()) throw std::invalid_argument("the state lacks '" + name + "'");
    if (!std::isfinite(found->second))
      throw std::invalid_argument("the state has a non-finite '" + name + "'");
    return found->second;
  };
  Sim copy = sim;
#define X(name, meaning) copy.x.name = value(#name);
  GANTRY_PLANT_STATE(X)
#undef X
#define X(name, meaning) copy.s.name = value("drive_" #name);
  GANTRY_DRIVE_STATE(X)
#undef X
  // A second motor at 0 would be wound up by all that the first has turned.
  if (sim.plant().p.second_pinion) value("pos_motor_2");
  // An effect that was off when the state was kept begins as its static start does not: with 0.
#define X(name, effect, meaning) copy.x.name = m.count(#name) != 0 ? value(#name) : 0.0;
  GANTRY_PLANT_EFFECT_STATE(X)
#undef X
  copy.brake.closed = value("brake_closed") != 0.0;
  const double countdown = value("brake_countdown");
  if (!(countdown >= 0.0 && countdown <= 1e9))
    throw std::invalid_argument("the state has a brake_countdown outside 0..1e9");
  copy.brake.countdown = std::trunc(countdown);
  copy.report.torque_mesh = value("report_torque_mesh");
  copy.report.vel = value("report_vel");
  copy.report.limited = value("report_limited") != 0.0;
  copy.count_offset = value("count_offset");
  const double scans_done = value("scans_done");
  if (!(scans_done >= 0.0 && scans_done <= 1e15))
    throw std::invalid_argument("the state has scans_done outside 0..1e15");
  copy.scans_done = std::trunc(scans_done);
  copy.encoder = EncoderFault<double>();
  if (m.count("encoder_gain") != 0)
    copy.encoder = {true, value("encoder_gain"), value("encoder_pos_start"), value("encoder_seen_start")};
  sim = copy;
}

double finite(double x, const char* name) {
  if (!std::isfinite(x)) throw std::invalid_argument(std::string(name) + " must be finite");
  return x;
}

using SampleRow = std::tuple<double, double, double, double, double, bool>;

std::vector<SampleRow> samples_taken(const Sim& sim) {
  std::vector<SampleRow> rows;
  rows.reserve(sim.samples.size());
  for (const auto& [s] : sim.samples) rows.emplace_back(s[0], s[1], s[2], s[3], s[4], s[5] != 0.0);
  return rows;
}

template <std::size_t N>
std::vector<double> first(const std::array<double, N>& all, int count) {
  return {all.begin(), all.begin() + std::clamp(count, 0, static_cast<int>(N))};
}

// Puts them at the beginning of `all`; returns how many they are.
template <std::size_t N>
int fill(std::array<double, N>& all, const std::vector<double>& given, const char* name) {
  if (given.empty() || given.size() > N)
    throw std::invalid_argument(std::string(name) + " needs 1.." + std::to_string(N) + " teeth, got " +
                                std::to_string(given.size()));
  for (double each : given) finite(each, name);
  all = {};
  std::copy(given.begin(), given.end(), all.begin());
  return static_cast<int>(given.size());
}

void bind_params(nb::module_& m) {
  nb::class_<Plant1> plant(m, "PlantParams",
                           "Parameters of the plant, SI, at the gantry unless the name says motor.");
  plant.def(nb::init<>()).def("copy", [](const Plant1& p) { return p; }, "An independent copy.");
#define X(name, value, meaning) plant.def_rw(#name, &Plant1::name, meaning);
  GANTRY_PLANT_PARAMS(X)
#undef X
  plant.def_rw("error_ring_rad", &Plant1::error_ring_rad, "gear error, n = 1..12 cycles per gantry turn, rad")
      .def_rw("phase_ring_rad", &Plant1::phase_ring_rad, "rad")
      .def_rw("wind_wave_nm", &Plant1::wind_wave_nm, "gusts of the wind: amplitudes, N m")
      .def_rw("wind_rate_rad_s", &Plant1::wind_rate_rad_s, "rad/s")
      .def_rw("wind_phase_rad", &Plant1::wind_phase_rad, "rad")
      .def_prop_rw(
          "ring_pitch_rad",
          [](const Plant1& p) { return first(p.pitch.ring_rad, p.tooth_pitch ? p.ring_teeth : 0); },
          [](Plant1& p, const std::vector<double>& given) {
            p.ring_teeth = fill(p.pitch.ring_rad, given, "ring_pitch_rad");
          },
          "Deviation of each tooth of the ring, rad; their number becomes ring_teeth.")
      .def_prop_rw(
          "pinion_pitch_rad",
          [](const Plant1& p) { return first(p.pitch.pinion_rad, p.tooth_pitch ? p.pinion_teeth : 0); },
          [](Plant1& p, const std::vector<double>& given) {
            p.pinion_teeth = fill(p.pitch.pinion_rad, given, "pinion_pitch_rad");
          },
          "Deviation of each tooth of the pinion, rad at the gantry; their number becomes pinion_teeth.")
      .def_prop_rw(
          "second_pinion_pitch_rad",
          [](const Plant1& p) {
            return first(p.pitch.second_pinion_rad, p.tooth_pitch && p.second_pinion ? p.pinion_teeth : 0);
          },
          [](Plant1& p, const std::vector<double>& given) {
            p.pinion_teeth = fill(p.pitch.second_pinion_rad, given, "second_pinion_pitch_rad");
          },
          "The same of the second pinion, which has as many teeth.");
#define X(name, type, value, meaning) plant.def_rw(#name, &Plant1::name, meaning);
  GANTRY_PLANT_SWITCHES(X)
#undef X

  nb::class_<Drive1> drive(m, "DriveParams", "Parameters of the simulated drive, SI, motor side.");
  drive.def(nb::init<>()).def("copy", [](const Drive1& p) { return p; }, "An independent copy.");
#define X(name, value, meaning) drive.def_rw(#name, &Drive1::name, meaning);
  GANTRY_DRIVE_PARAMS(X)
#undef X
  drive.def_rw("encoder_errors", &Drive1::encoder_errors, "errors of the motor encoder present");
  drive.def_rw("delay_cycles", &Drive1::delay_cycles,
               "0 or 1: cycles between computing a torque and its effect");
}

using Feedback = std::tuple<double, double, double, bool, bool, double, double, double, double>;
using Truth = std::tuple<double, double, double, double, double, double, double>;

void bind_sim(nb::module_& m) {
  nb::class_<Sim>(m, "GantrySim", "Drive, brake, encoder and gantry: one call advances one scan.")
      .def(
          "__init__",
          [](Sim* self, const Plant1& plant, const Drive1& drive, double scan_period_s,
             const std::string& scheme,
             int rk4_steps) { new (self) Sim(make_sim(plant, drive, scan_period_s, scheme, rk4_steps)); },
          nb::arg("plant"), nb::arg("drive"), nb::arg("scan_period_s"), nb::arg("scheme") = "one_evaluation",
          nb::arg("rk4_steps") = 2)
      .def("static_start", &Sim::static_start, nb::arg("theta_rad"), nb::arg("servo_on"),
           "Stand still at an angle: servo on and holding the load, or drive off and the brake holding it.")
      .def(
          "scan",
          [](Sim& sim, int mode, double vel_cmd_rad_s, double torque_ff_nm, bool brake_open) {
            kernels().scan(sim, {drive_mode(mode), vel_cmd_rad_s, torque_ff_nm}, brake_open);
          },
          nb::arg("mode"), nb::arg("vel_cmd_rad_s"), nb::arg("torque_ff_nm"), nb::arg("brake_open"),
          "Advance one scan. mode: 0 off, 1 speed, 2 quick stop; commands at the motor.")
      .def(
          "advance", [](Sim& sim, double torque_nm, double dt_s) { sim.advance(torque_nm, dt_s); },
          nb::arg("torque_nm"), nb::arg("dt_s"),
          "The plant alone for one drive cycle with a given torque set-point; no drive, no encoder.")
      .def(
          "feedback",
          [](const Sim& sim, double count_rad) {
            return Feedback(sim.counts(count_rad), sim.vel_report(), sim.torque_act(), !sim.brake.closed,
                            sim.limited(), sim.overload(), sim.s.ramp, sim.ring_reading(), sim.x.pos_load);
          },
          nb::arg("count_rad"),
          "(counts, speed rad/s, torque N m, brake open, torque limited, overload 0..1, speed ramp rad/s), "
          "motor side; then the load-side encoder, rad, 0 without one, and the true load angle, rad, for "
          "limit "
          "switches.\n\n"
          "count_rad is the motor angle of one count; counts are whole numbers unless the encoder is ideal.")
      .def(
          "truth",
          [](const Sim& sim) {
            return Truth(sim.x.pos_load, sim.x.vel_load, sim.x.pos_motor, sim.x.vel_motor, sim.x.pos_base,
                         sim.x.vel_base, sim.torque_mesh());
          },
          "(load angle, load speed, motor angle, motor speed, base angle, base speed, mesh torque), rad, "
          "rad/s, N m.")
      .def(
          "copy", [](const Sim& sim) { return sim; }, "An independent copy, state included.")
      .def(
          "fit_load_encoder",
          [](Sim& sim, double step_rad, double noise_rad, double latency_s, const ScaleTerms& scale) {
            sim.ring_encoder = make_load_encoder(step_rad, noise_rad, latency_s, scale);
          },
          nb::arg("step_rad"), nb::arg("noise_rad"), nb::arg("latency_s"), nb::arg("scale"),
          "Put an encoder on the ring. scale: at most 4 of (waves per turn, amplitude rad, phase rad).")
      .def(
          "ring_reading", [](const Sim& sim) { return sim.ring_reading(); },
          "Reading of the load-side encoder in this scan, rad; 0 without one.")
      .def_prop_rw(
          "encoder_gain", [](const Sim& sim) { return sim.encoder.gain; },
          [](Sim& sim, double gain) { sim.set_encoder_gain(finite(gain, "encoder_gain")); },
          "Part of the shaft's motion that the encoder shows from now on, also to the drive's own loops: 1 "
          "sound, "
          "0 frozen, -1 sign wrong, 0.9 a coupling that slips. Where it shows the shaft is continuous.")
      .def(
          "jump_encoder",
          [](Sim& sim, double angle_rad) { sim.jump_encoder(finite(angle_rad, "angle_rad")); },
          nb::arg("angle_rad"),
          "Shift what the reading and the drive's own loops see by an angle of the motor.")
      .def(
          "sample_every",
          [](Sim& sim, int cycles) {
            if (cycles < 0) throw std::invalid_argument("drive cycles between two samples: 0 (none) or more");
            sim.sample_every = cycles;
            sim.samples.clear();
          },
          nb::arg("cycles"),
          "Take samples of the true state inside each scan, every so many drive cycles; 0: none.")
      .def("samples_taken", &samples_taken,
           "Samples of the last scan: (motor angle, motor speed, load angle, load speed, motor torque, brake "
           "closed), rad, rad/s, N m.")
      .def_rw("count_offset", &Sim::count_offset, "Encoder mounting, counts: added to every reading.")
      .def_prop_rw("state", &get_state, &set_state,
                   "The whole state by name; a float survives JSON bit for bit.")
      .def_prop_ro("scan_period_s", &Sim::scan_period_s);
}

// The equations one by one, so that tests can hold each against its closed form.
void bind_equations(nb::module_& m) {
  using Pair = std::tuple<double, double>;
  m.def(
      "ring_error",
      [](const Plant1& p, double rho) {
        const auto e = GearError<double>(p).ring_error(rho);
        return Pair(e.error, e.slope);
      },
      nb::arg("plant"), nb::arg("rho_rad"), "Gear error of the ring and its slope (S2).");
  m.def(
      "motor_error",
      [](const Plant1& p, double pos_motor) {
        const auto e = GearError<double>(p).motor_error(pos_motor);
        return Pair(e.error, e.slope);
      },
      nb::arg("plant"), nb::arg("pos_motor_rad"), "Gear error of reducer and pinion and its slope (S2).");
  m.def(
      "pitch_error",
      [](const Plant1& p, double rho, double pos_motor) {
        if (!p.tooth_pitch) throw std::invalid_argument("the plant has no single teeth: tooth_pitch is off");
        check_teeth(p);
        const auto ring = ring_pitch_error(p, rho), pinion = pinion_pitch_error(p, pos_motor);
        return std::tuple(ring.error, ring.slope, ring.curvature, pinion.error, pinion.slope,
                          pinion.curvature);
      },
      nb::arg("plant"), nb::arg("rho_rad"), nb::arg("pos_motor_rad"),
      "Pitch error of the ring's tooth in mesh with slope and curvature over rho, of the pinion's over the "
      "motor angle (S13).");
  m.def(
      "encoder_error",
      [](const Drive1& p, double pos_motor) { return encoder_position(p, pos_motor, 0.0) - pos_motor; },
      nb::arg("drive"), nb::arg("pos_motor_rad"), "What the motor encoder shows too much, rad (S13).");
  m.def(
      "spring_torque",
      [](const Plant1& p, double windup) {
        const Plant<double> plant(p);
        return windup < 0.0 ? -plant.spring(-windup) : plant.spring(windup);
      },
      nb::arg("plant"), nb::arg("windup_rad"), "Torque of the three-slope transmission, N m (S3).");
  m.def(
      "windup",
      [](const Plant1& p, double torque) { return sign(torque) * Plant<double>(p).windup(vabs(torque)); },
      nb::arg("plant"), nb::arg("torque_nm"),
      "Wind-up of the three-slope transmission, rad: inverse of spring_torque.");
  m.def(
      "sliding_gate",
      [](double v, double z, double z_ss, double ep_ratio) { return gate_of(ep_ratio)(v, z, 1.0 / z_ss); },
      nb::arg("v"), nb::arg("z"), nb::arg("z_ss"), nb::arg("ep_ratio"),
      "Elasto-plastic gate alpha(v, z, z_ss): 0 elastic, 1 sliding (S3).");
  m.def("clamp", &clamp<double>, nb::arg("x"), nb::arg("lo"), nb::arg("hi"),
        "Limit x to lo..hi; NaN passes through.");
  m.def(
      "sincos",
      [](double x) {
        const auto r = sincos(x);
        return Pair(r.sin, r.cos);
      },
      nb::arg("x"), "Sine and cosine of the kernels, |x| < 1e6.");
  m.def("exp", &vexp<double>, nb::arg("x"), "Exponential of the kernels.");
}

}  // namespace

DriveMode drive_mode(int mode) {
  if (mode < 0 || mode > 2) throw std::invalid_argument("mode must be 0 (off), 1 (speed) or 2 (quick stop)");
  return static_cast<DriveMode>(mode);
}

void bind_plant(nb::module_& m) {
  bind_params(m);
  bind_sim(m);
  bind_equations(m);
}
