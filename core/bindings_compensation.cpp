#include <nanobind/stl/map.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <cmath>
#include <map>
#include <stdexcept>
#include <string>
#include <tuple>
#include <vector>

#include "core/bindings.hpp"
#include "core/control/compensated_law.hpp"

namespace nb = nanobind;
using namespace gantry;
using Law = Compensation<double>;
using Params = CompensationParams<double>;
using Result = std::tuple<double, double, double, double, double, double>;
using Numbers = std::map<std::string, double>;
using Switches = std::map<std::string, bool>;
using Waves = std::vector<std::tuple<double, double, double>>;

namespace {

void finite(double x, const char* what) {
  if (!std::isfinite(x)) throw std::invalid_argument(std::string(what) + " is not finite");
}

template <int N>
Harmonics<double, N> make_harmonics(const std::vector<double>& values, const char* name) {
  Harmonics<double, N> h;
  if (values.size() > 2 * N + 1)
    throw std::invalid_argument(std::string(name) + " has more than " + std::to_string(N) + " harmonics");
  h.used = static_cast<int>(values.size() / 2);
  for (std::size_t k = 0; k < values.size(); ++k) {
    finite(values[k], name);
    if (k == 0)
      h.mean = values[k];
    else if (k % 2 == 1)
      h.sine[(k - 1) / 2] = values[k];
    else
      h.cosine[(k - 1) / 2] = values[k];
  }
  return h;
}

void set_switches(Params& p, Switches given) {
#define X(name, meaning)         \
  if (given.count(#name) != 0) { \
    p.name = given[#name];       \
    given.erase(#name);          \
  }
  GANTRY_COMPENSATION_SWITCHES(X)
#undef X
  if (!given.empty()) throw std::invalid_argument("no compensation is called " + given.begin()->first);
}

void set_numbers(Params& p, Numbers given) {
#define X(name, value, meaning)  \
  if (given.count(#name) != 0) { \
    p.name = given[#name];       \
    finite(p.name, #name);       \
    given.erase(#name);          \
  }
  GANTRY_COMPENSATION_PARAMS(X)
#undef X
  if (!given.empty())
    throw std::invalid_argument("no number of the compensation is called " + given.begin()->first);
  for (double x : {p.period_s, p.jerk_max_rad_s3, p.reversal_length_rad, p.fade_rad_s, p.flank_nm})
    if (!(x > 0.0))
      throw std::invalid_argument(
          "period_s, jerk_max_rad_s3, reversal_length_rad, fade_rad_s and flank_nm must be positive");
  if (p.moment_observer && !(p.moment_limit_nm > 0.0 && p.friction_spread_nm > 0.0))
    throw std::invalid_argument("moment_limit_nm and friction_spread_nm must be positive");
  if (p.backlash_observer && !(p.moment_observer && p.friction_nm > 0.0 && p.friction_load_nm > 0.0 &&
                               p.inertia_load_kg_m2 > 0.0 && p.windup_per_acc_s2 > 0.0))
    throw std::invalid_argument(
        "the backlash observer needs the moment observer, friction, inertia and wind-up");
  if (p.backlash_observer && p.load_encoder && !(p.swing_rad_s > 0.0))
    throw std::invalid_argument("the backlash observer needs swing_rad_s beside the load-side encoder");
  if (!(p.backlash_step_rad > 0.0)) throw std::invalid_argument("backlash_step_rad must be positive");
  for (double x : {p.observer_memory, p.backlash_memory})
    if (!(x > 0.0 && x <= 1.0))
      throw std::invalid_argument("observer_memory and backlash_memory must lie above 0, and be 1 at most");
  for (double x : {p.observer_speed_rad_s, p.observer_weight, p.observer_rate, p.torque_limit_nm,
                   p.pos_limit_rad, p.backlash_rad, p.backlash_held_rad, p.lean_rad_per_nm, p.backlash_fast,
                   p.backlash_slow, p.encoder_limit_rad, p.encoder_dead_band_rad, p.swing_speed_max_rad_s})
    if (!(x >= 0.0)) throw std::invalid_argument("a limit of the compensation is negative");
}

Params make_params(const Switches& switches, const Numbers& numbers, const std::vector<double>& map,
                   const std::vector<double>& lost_motion, const std::vector<double>& scale,
                   const Waves& fast) {
  Params p;
  set_switches(p, switches);
  set_numbers(p, numbers);
  p.map = make_harmonics<kMapHarmonics>(map, "map");
  p.lost_motion = make_harmonics<kReversalHarmonics>(lost_motion, "lost_motion");
  p.scale = make_harmonics<kScaleHarmonics>(scale, "scale");
  if (fast.size() > kFastWaves)
    throw std::invalid_argument("at most " + std::to_string(kFastWaves) + " fast waves");
  p.fast_used = static_cast<int>(fast.size());
  for (std::size_t k = 0; k < fast.size(); ++k) {
    const auto [cycles, sine, cosine] = fast[k];
    for (double x : {cycles, sine, cosine}) finite(x, "a fast wave");
    p.fast[k] = {cycles, sine, cosine};
  }
  return p;
}

Result run(Law& law, const PositionLawParams<double>& position, const SetPoint<double>& r, double counts,
           double ring, double torque_nm) {
  const auto out = compensated_law(position, law.p, law.s, r, counts, ring, torque_nm);
  return {out.law.vel_cmd_rad_s, out.law.pos_act_rad,  out.law.pos_err_rad,
          out.torque_ff_nm,      out.disagreement_rad, out.moment_change_nm};
}

// The axis begins to follow anew; direction and bias describe the machine and stay, unless they are no
// numbers.
void restart(Law& law) {
  CompensationState<double>& s = law.s;
  s.started = false;
  if (!std::isfinite(s.bias_rad)) s.bias_rad = 0.0;
  if (!std::isfinite(s.direction)) s.direction = 0.0;
  law.before = s;
}

// The angles that a scan leaves to the next; everything else is a difference or goes round with the axis.
void turn_back(Law& law, double angle_rad) {
  for (CompensationState<double>* s : {&law.s, &law.before}) {
    s->pos_last_rad -= angle_rad;
    s->ring_last_rad -= angle_rad;
    s->motor_last_rad -= angle_rad;
  }
}

Numbers state_of(const Law& law) {
  Numbers m;
#define X(name, meaning) m[#name] = law.s.name;
  GANTRY_COMPENSATION_STATE(X)
#undef X
  return m;
}

Numbers parameters_of(const Law& law) {
  Numbers m;
#define X(name, meaning) m[#name] = law.p.name ? 1.0 : 0.0;
  GANTRY_COMPENSATION_SWITCHES(X)
#undef X
#define X(name, value, meaning) m[#name] = law.p.name;
  GANTRY_COMPENSATION_PARAMS(X)
#undef X
  return m;
}

}  // namespace

void bind_compensation(nb::module_& m) {
  m.attr("MAP_HARMONICS") = kMapHarmonics;
  m.attr("REVERSAL_HARMONICS") = kReversalHarmonics;
  m.attr("SCALE_HARMONICS") = kScaleHarmonics;
  m.attr("FAST_WAVES") = kFastWaves;
  m.attr("BACKLASH_MODELS") = kBacklashModels;
#define X(name, meaning) #name,
  m.attr("COMPENSATIONS") = nb::cast(std::vector<std::string>{GANTRY_COMPENSATION_SWITCHES(X)});
#undef X
  nb::class_<Law>(m, "Compensation", "Compensations of one axis around its position law, with their state.")
      .def(
          "__init__",
          [](Law* self, const Switches& switches, const Numbers& numbers, const std::vector<double>& map,
             const std::vector<double>& lost_motion, const std::vector<double>& scale, const Waves& fast) {
            new (self) Law{make_params(switches, numbers, map, lost_motion, scale, fast), {}, {}};
          },
          nb::arg("switches"), nb::arg("numbers"), nb::arg("map") = std::vector<double>(),
          nb::arg("lost_motion") = std::vector<double>(), nb::arg("scale") = std::vector<double>(),
          nb::arg("fast") = Waves(),
          "Switches and numbers by name; maps as [mean, sine 1, cosine 1, sine 2, ...] in rad over the "
          "gantry "
          "angle;\nfast: (cycles per gantry turn, sine, cosine).")
      .def(
          "scan",
          [](Law& law, const PositionLawParams<double>& position, double pos, double vel, double acc,
             double counts, double ring, double torque_nm) {
            law.before = law.s;
            return run(law, position, {pos, vel, acc}, counts, ring, torque_nm);
          },
          nb::arg("law"), nb::arg("pos_ref_rad"), nb::arg("vel_ref_rad_s"), nb::arg("acc_ref_rad_s2"),
          nb::arg("counts"), nb::arg("pos_ring_rad"), nb::arg("torque_nm"),
          "Speed command (motor side, clamped), actual load position, following error (gantry side),\n"
          "torque to feed forward (motor side, clamped), load-side encoder minus maps (gantry side),\nchange "
          "of the "
          "eccentric moment since the calibration (gantry side).")
      .def(
          "scan_again",
          [](Law& law, const PositionLawParams<double>& position, double pos, double vel, double acc,
             double counts, double ring, double torque_nm) {
            law.s = law.before;
            return run(law, position, {pos, vel, acc}, counts, ring, torque_nm);
          },
          nb::arg("law"), nb::arg("pos_ref_rad"), nb::arg("vel_ref_rad_s"), nb::arg("acc_ref_rad_s2"),
          nb::arg("counts"), nb::arg("pos_ring_rad"), nb::arg("torque_nm"),
          "The scan just done, with another set-point: instead of it, not after it.")
      .def("restart", &restart, "The axis begins to follow anew with its next scan.")
      .def("turn_back", &turn_back, nb::arg("angle_rad"),
           "Count the angles of the next scan from a zero that lies so much further on: whole turns.")
      .def(
          "forget_bias", [](Law& law) { law.s.bias_rad = law.before.bias_rad = 0.0; },
          "After a new reference: what the load-side loop has learned no longer holds.")
      .def(
          "resting_position",
          [](const Law& law, const PositionLawParams<double>& position, double counts) {
            return resting_position(position, law.p, law.s, counts);
          },
          nb::arg("law"), nb::arg("counts"), "Where the load is at rest, by motor encoder and maps, rad.")
      .def(
          "lead",
          [](const Law& law, double pos_rad) {
            return map_correction(law.p, moment_now(law.p, law.s), flank_now(law.p, law.s), law.s.direction,
                                  0.0, pos_rad, 0.0, 0.0, 0.0)
                .pos;
          },
          nb::arg("pos_rad"), "How far the motor leads the load at rest by the maps, rad at the gantry.")
      .def(
          "copy", [](const Law& law) { return law; }, "An independent copy, state included.")
      .def_prop_ro(
          "backlash_change_rad", [](const Law& law) { return law.s.backlash_change_rad; },
          "Change of the backlash since the calibration that is in use, rad.")
      .def_prop_ro("state", &state_of, "The state by name.")
      .def_prop_ro("parameters", &parameters_of, "Switches (0 or 1) and numbers by name.");
}
