// Drive, brake and plant together: what hangs behind a simulated drive port. One call advances one scan.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/plant/drive.hpp"
#include "core/plant/encoder_fault.hpp"
#include "core/plant/integration.hpp"
#include "core/plant/load_encoder.hpp"

namespace gantry {

// The holding brake: commanded, and closed or open after its dead times.
struct Brake {
  bool closed = true;
  int countdown = 0;  // drive cycles until `closed` follows the command; 0: it does

  // Start of a scan. A command taken back ends the dead time; a brake without one follows at once: true.
  bool command(bool open, int close_cycles, int open_cycles) {
    if (open != closed) countdown = 0;
    if (open != closed || countdown > 0) return false;
    countdown = closed ? open_cycles : close_cycles;
    if (countdown > 0) return false;
    closed = !closed;
    return true;
  }

  // End of a drive cycle; true when the brake has followed its command.
  bool cycle() {
    if (countdown == 0 || --countdown > 0) return false;
    closed = !closed;
    return true;
  }
};

template <class T>
class GantrySim {
 public:
  // What the last scan leaves to be shown; nothing is computed from it.
  struct Report {
    T torque_mesh = T(0.0);
    T vel = T(0.0);  // mean motor speed over the scan, from the encoder
    bool limited = false;
  };

  // The true state after a drive cycle: motor angle and speed, load angle and speed, motor torque, brake
  // closed.
  using Sample = std::array<T, 6>;

  GantrySim() = default;
  GantrySim(const PlantParams<T>& plant, const DriveParams<T>& drive, double scan_period_s,
            int cycles_per_scan, int brake_close_cycles, int brake_open_cycles, double cycle_s, Scheme scheme,
            int rk4_steps)
      : plant_(plant),
        drive_(drive),
        current_(plant, cycle_s),
        cycle_s_(cycle_s),
        scan_period_s_(scan_period_s),
        cycles_per_scan_(cycles_per_scan),
        close_cycles_(brake_close_cycles),
        open_cycles_(brake_open_cycles),
        scheme_(scheme),
        rk4_steps_(rk4_steps) {}

  // Standing still at theta0 (S8): servo on and holding the load, or drive off and the closed brake holding
  // it.
  void static_start(T theta0, bool servo_on) {
    const PlantParams<T>& p = plant_.p;
    x = PlantState<T>();
    s = DriveState<T>();
    scans_done = 0;
    brake.closed = !servo_on;
    brake.countdown = 0;
    encoder = EncoderFault<T>();
    const T torque_mesh = -EccentricTorque<T>(p, theta0)(theta0);
    const T torque_motor = torque_mesh / p.ratio;
    x.pos_load = theta0;
    x.pos_motor = p.ratio * theta0;
    if (!p.rigid) settle_gears(theta0, torque_mesh);
    report = Report();
    report.torque_mesh = torque_mesh;
    if (servo_on) {
      x.torque_motor = torque_motor;
      s.torque_set = torque_motor;
      s.integral = torque_motor / drive_.p.kvp_nm_s_per_rad;
    } else {
      x.brake_z = -torque_motor / plant_.brake.stiffness;
    }
    s.pos_last = encoder_position(drive_.p, x.pos_motor, x.vel_motor, drive_.p.speed_count_rad);
  }

  // One scan: the drive cycles that fit into it, with the command held.
  void scan(const DriveCommand<T>& command, bool brake_open) {
    report.limited = false;
    samples.clear();
    const T start = s.pos_last;
    const T dt = T(cycle_s_);
    const EccentricTorque<T> eccentric(plant_.p, x.pos_load);
    if (brake.command(brake_open, close_cycles_, open_cycles_)) x.brake_z = brake_grip();
    for (int k = 0; k < cycles_per_scan_; ++k) {
      const T u = encoder.spoilt ? drive_cycle(drive_, command, s, encoder.position(x.pos_motor),
                                               encoder.speed(x.vel_motor), report.limited)
                                 : drive_cycle(drive_, command, s, x.pos_motor, x.vel_motor, report.limited);
      step(eccentric, u, dt);
      if (brake.cycle()) x.brake_z = brake_grip();
      if (sample_every > 0 && (k + 1) % sample_every == 0) samples.push_back(sample());
    }
    report.vel = (s.pos_last - start) / (dt * T(cycles_per_scan_));
    ++scans_done;
    flush();
  }

  // One drive cycle of the plant alone, torque u; for tests without a controller.
  void advance(T u, T dt) { step(EccentricTorque<T>(plant_.p, x.pos_load), u, dt); }

  // Encoder counts since its own zero; whole numbers unless the encoder is ideal. A resolution of several
  // counts must be a whole number of them.
  T counts(T count) const {
    const DriveParams<T>& p = drive_.p;
    const T pos = encoder.spoilt
                      ? encoder_position(p, encoder.position(x.pos_motor), encoder.speed(x.vel_motor), T(0.0))
                      : encoder_position(p, x.pos_motor, x.vel_motor, T(0.0));
    const auto real = p.position_count_rad > T(0.0);
    const T steps = vround(pos / select(real, p.position_count_rad, T(1.0)));
    return select(real, steps * (p.position_count_rad / count), pos / count) + count_offset;
  }

  // From now on the encoder shows `gain` x the shaft's motion, to the reading and to the drive's own loops:
  // 0 frozen, -1 sign wrong, 0.9 a coupling that slips; 1 sound again, at the angle it has come to.
  void set_encoder_gain(T gain) { encoder.set_gain(gain, x.pos_motor); }

  // The encoder jumps by an angle of the motor, for the reading and for the drive's own loops.
  void jump_encoder(T angle) { encoder.jump(angle, x.pos_motor); }

  // Used part of the I2t budget, 0..1.
  T overload() const {
    const auto has_budget = drive_.budget_s > T(0.0);
    return select(has_budget, s.overload / select(has_budget, drive_.budget_s, T(1.0)), T(0.0));
  }

  // The load-side encoder in this scan, rad; 0 without one. For one plant, not for a pack.
  double ring_reading() const {
    if (!ring_encoder.fitted) return 0.0;
    return load_encoder_reading(ring_encoder, x.pos_load - x.pos_base, x.vel_load - x.vel_base, scans_done);
  }

  T torque_mesh() const { return report.torque_mesh; }
  T vel_report() const { return report.vel; }
  bool limited() const { return report.limited; }
  const Plant<T>& plant() const { return plant_; }

  // As given, not cycle * cycles: a rounding error apart, and every time stamp of a run would differ.
  double scan_period_s() const { return scan_period_s_; }
  double cycle_s() const { return cycle_s_; }

  PlantState<T> x;
  DriveState<T> s;
  Brake brake;
  Report report;
  LoadEncoderParams ring_encoder;
  EncoderFault<T> encoder;
  int sample_every = 0;          // drive cycles between two samples of a scan; 0: none are taken
  std::vector<Sample> samples;   // of the last scan
  std::uint64_t scans_done = 0;  // numbers the readings of the ring encoder
  T count_offset = T(0.0);       // where the encoder is mounted on the shaft, counts; turns it has lost

 private:
  GANTRY_INLINE void step(const EccentricTorque<T>& eccentric, T u, T dt) {
    if (scheme_ == Scheme::kOneEvaluation)
      step_one_evaluation(plant_, current_, eccentric, u, brake.closed, dt, x, report.torque_mesh);
    else
      step_runge_kutta(plant_, current_, eccentric, u, brake.closed, dt, rk4_steps_, x, report.torque_mesh);
  }

  // Base deflection, wind-up and gear error for a static mesh torque, by fixed-point iteration.
  void settle_gears(T theta0, T torque_mesh) {
    const PlantParams<T>& p = plant_.p;
    if (p.base) x.pos_base = -torque_mesh / p.base_stiffness_nm_per_rad;
    const T rho = theta0 - x.pos_base;
    const auto loaded = vabs(torque_mesh) > T(0.0);
    const T twist =
        sign(torque_mesh) * (plant_.windup(vabs(torque_mesh)) + select(loaded, p.half_backlash_rad, T(0.0)));
    const T ring = p.gear_error ? plant_.gear.ring_error(rho).error : T(0.0);
    for (int k = 0; k < 50; ++k) {
      const T em = p.gear_error ? plant_.gear.motor_error(x.pos_motor, sincos(x.pos_motor)).error : T(0.0);
      x.pos_motor = p.ratio * (rho + twist - em - ring);
    }
  }

  Sample sample() const {
    return {x.pos_motor, x.vel_motor, x.pos_load, x.vel_load, x.torque_motor, T(brake.closed ? 1.0 : 0.0)};
  }

  // Where the brake element begins when it closes: on a turning shaft it slips at once, its pre-sliding
  // length is passed in microseconds. Opened, it is gone.
  T brake_grip() const {
    if (!brake.closed) return T(0.0);
    const T slip = plant_.p.brake_presliding_rad * sign(x.vel_motor);
    return select(vabs(x.vel_motor) * T(cycle_s_) > plant_.p.brake_presliding_rad, slip, T(0.0));
  }

  void flush() {
#define X(name, meaning) x.name = flush_subnormal(x.name);
    GANTRY_PLANT_STATE(X)
#undef X
    s.integral = flush_subnormal(s.integral);
    s.vel_filtered = flush_subnormal(s.vel_filtered);
    s.torque_set = flush_subnormal(s.torque_set);
  }

  Plant<T> plant_;
  Drive<T> drive_;
  CurrentLoop<T> current_;
  double cycle_s_ = 125e-6;
  double scan_period_s_ = 1e-3;
  int cycles_per_scan_ = 8;
  int close_cycles_ = 0;
  int open_cycles_ = 0;
  Scheme scheme_ = Scheme::kOneEvaluation;
  int rk4_steps_ = 2;
};

}  // namespace gantry
