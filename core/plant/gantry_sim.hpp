// Drive, brake and plant together: what hangs behind a simulated drive port. One call advances one scan.
#pragma once

#include <algorithm>
#include <limits>
#include <vector>

#include "core/plant/drive.hpp"
#include "core/plant/encoder_fault.hpp"
#include "core/plant/integration.hpp"
#include "core/plant/load_encoder.hpp"

namespace gantry::GANTRY_ISA {

// The holding brake: commanded, and closed or open after its dead times; in a pack each for itself.
template <class T>
struct Brake {
  MaskOf<T> closed = mask<T>(true);
  T countdown = T(0.0);  // drive cycles until `closed` follows the command; 0: it does

  // Start of a scan. A command taken back ends the dead time; a brake without one follows at once: true.
  MaskOf<T> command(MaskOf<T> open, T close_cycles, T open_cycles) {
    const auto taken_back = differ(open, closed);
    countdown = select(taken_back, T(0.0), countdown);
    const auto starts = negate(either(taken_back, countdown > T(0.0)));
    countdown = select(starts, select(closed, open_cycles, close_cycles), countdown);
    const auto at_once = both(starts, negate(countdown > T(0.0)));
    closed = differ(closed, at_once);
    return at_once;
  }

  // End of a drive cycle; true when the brake has followed its command.
  GANTRY_INLINE MaskOf<T> cycle() {
    const auto counting = countdown > T(0.0);
    if (!any(counting)) return counting;
    countdown = select(counting, countdown - T(1.0), countdown);
    const auto follows = both(counting, negate(countdown > T(0.0)));
    closed = differ(closed, follows);
    return follows;
  }
};

// How time passes for a plant; one and the same in a pack.
struct Timing {
  double scan_period_s;
  double cycle_s;
  int cycles_per_scan;
  Scheme scheme;
  int rk4_steps;
  double anchor_period_s = 1e-3;  // waves are evaluated in full at most this far apart (anchor.hpp)
};

template <class T>
class GantrySim {
 public:
  // What the last scan leaves to be shown; nothing is computed from it.
  struct Report {
    T torque_mesh = T(0.0);
    T vel = T(0.0);  // mean motor speed over the scan, from the encoder
    MaskOf<T> limited = mask<T>(false);
  };

  // The true state after a drive cycle: motor angle and speed, load angle and speed, motor torque, brake
  // closed.
  struct Sample {
    T values[6];
  };

  GantrySim() = default;  // to be built before it is used
  GantrySim(const PlantParams<T>& plant, const DriveParams<T>& drive, T brake_close_cycles,
            T brake_open_cycles, const Timing& timing) {
    build(plant, drive, brake_close_cycles, brake_open_cycles, timing);
  }

  // Other parameters; the state stays.
  void build(const PlantParams<T>& plant, const DriveParams<T>& drive, T brake_close_cycles,
             T brake_open_cycles, const Timing& timing) {
    plant_ = Plant<T>(plant);
    drive_ = Drive<T>(drive);
    drive_.p.two_motors = plant.second_pinion;
    current_ = CurrentLoop<T>(plant, timing.cycle_s);
    close_cycles_ = brake_close_cycles;
    open_cycles_ = brake_open_cycles;
    timing_ = timing;
    cycles_per_anchor_ = std::max(1, static_cast<int>(timing.anchor_period_s / timing.cycle_s + 1e-6));
  }

  // Standing still at theta0 (S8): servo on and holding the load, or drive off and the closed brake holding
  // it.
  void static_start(T theta0, bool servo_on) {
    const PlantParams<T>& p = plant_.p;
    x = PlantState<T>();
    s = DriveState<T>();
    scans_done = T(0.0);
    samples.clear();
    brake.closed = mask<T>(!servo_on);
    brake.countdown = T(0.0);
    encoder = EncoderFault<T>();
    T torque_mesh = -EccentricTorque<T>(p, theta0)(theta0);
    if (p.wind) torque_mesh = torque_mesh - p.wind_moment_nm;
    x.pos_load = theta0;
    x.pos_motor = p.ratio * theta0;
    if (p.base && !p.rigid) x.pos_base = -torque_mesh / p.base_stiffness_nm_per_rad;
    if (p.cable) torque_mesh = torque_mesh - cable_moment(p, theta0 - x.pos_base);
    const Thermal<T> thermal(p, T(0.0));
    report = Report();
    if (p.ageing) x.roller_age = x.motor_age = T(1.0);  // it has stood for long
    if (p.second_pinion) {
      stand_on_two(torque_mesh, thermal, servo_on);
      return;
    }
    if (!p.rigid)
      settle_gears(plant_.gear, first_train(x), first_place(), torque_mesh, thermal.half_backlash);
    T torque_motor = torque_mesh / p.ratio;
    if (p.cogging) torque_motor = torque_motor - cogging_at(plant_.gear, x.pos_motor);
    report.torque_mesh = torque_mesh;
    if (servo_on) {
      if (p.thermal || p.torque_constant) torque_motor = torque_motor / thermal.motor_torque;
      x.torque_motor = torque_motor;
      s.torque_set = torque_motor;
      s.integral = torque_motor / drive_.p.kvp_nm_s_per_rad;
    } else {
      x.brake_z = -torque_motor / plant_.brake.stiffness;
    }
    s.pos_last = counted_position(drive_, x.pos_motor, x.vel_motor);
  }

  // One scan: the drive cycles that fit into it, with the command held.
  void scan(const DriveCommand<T>& command, MaskOf<T> brake_open) {
    report.limited = mask<T>(false);
    samples.clear();
    const T start = s.pos_last;
    const T dt = T(timing_.cycle_s);
    Anchor<T> anchor = here(0);
    int anchored = 0;  // drive cycles since then
    grip_where(brake.command(brake_open, close_cycles_, open_cycles_));
    for (int k = 0; k < timing_.cycles_per_scan; ++k) {
      if (anchored++ == cycles_per_anchor_) {
        anchor = here(k);
        anchored = 1;
      }
      const MotorTorques<T> u =
          encoder.spoilt ? drive_cycle(drive_, command, s, encoder.position(x.pos_motor),
                                       encoder.speed(x.vel_motor), report.limited)
                         : drive_cycle(drive_, command, s, x.pos_motor, x.vel_motor, report.limited);
      step(anchor, u, dt);
      grip_where(brake.cycle());
      if (sample_every > 0 && (k + 1) % sample_every == 0) samples.push_back(sample());
    }
    report.vel = (s.pos_last - start) / (dt * T(timing_.cycles_per_scan));
    scans_done = scans_done + T(1.0);
    flush();
  }

  // One drive cycle of the plant alone, torque u, which two motors share; for tests without a controller.
  void advance(T u, T dt) {
    Anchor<T> anchor = here(0);
    const T no_limit = T(std::numeric_limits<double>::infinity());
    step(anchor, plant_.p.second_pinion ? shared(u, drive_.p.preload_nm, no_limit) : MotorTorques<T>{u, {}},
         dt);
  }

  // Torque of the axis, as the drive reports it: of both motors where there are two.
  GANTRY_INLINE T torque_act() const {
    return plant_.p.second_pinion ? x.torque_motor + x.torque_motor_2 : x.torque_motor;
  }

  // Encoder counts since its own zero; whole numbers unless the encoder is ideal. A resolution of several
  // counts must be a whole number of them.
  T counts(T count) const {
    const DriveParams<T>& p = drive_.p;
    const T pos = encoder.spoilt
                      ? encoder_position(p, encoder.position(x.pos_motor), encoder.speed(x.vel_motor))
                      : encoder_position(p, x.pos_motor, x.vel_motor);
    const auto real = p.position_count_rad > T(0.0);
    const T steps = vround(pos / p.position_count_rad);
    return select(real, steps * (p.position_count_rad / count), pos / count) + count_offset;
  }

  // From now on the encoder shows `gain` x the shaft's motion, to the reading and to the drive's own loops:
  // 0 frozen, -1 sign wrong, 0.9 a coupling that slips; 1 sound again, at the angle it has come to.
  void set_encoder_gain(T gain) { encoder.set_gain(gain, x.pos_motor); }

  // The encoder jumps by an angle of the motor, for the reading and for the drive's own loops.
  void jump_encoder(T angle) { encoder.jump(angle, x.pos_motor); }

  // Used part of the I2t budget, 0..1.
  T overload() const { return select(drive_.budget_s > T(0.0), s.overload / drive_.budget_s, T(0.0)); }

  // The load-side encoder in this scan, rad; 0 without one.
  T ring_reading() const {
    if (!ring_encoder.fitted) return T(0.0);
    return load_encoder_reading(ring_encoder, x.pos_load - x.pos_base, x.vel_load - x.vel_base, scans_done);
  }

  T torque_mesh() const { return report.torque_mesh; }
  T vel_report() const { return report.vel; }
  MaskOf<T> limited() const { return report.limited; }
  const Plant<T>& plant() const { return plant_; }
  const Drive<T>& drive() const { return drive_; }
  T brake_close_cycles() const { return close_cycles_; }
  T brake_open_cycles() const { return open_cycles_; }
  const Timing& timing() const { return timing_; }

  // As given, not cycle * cycles: a rounding error apart, and every time stamp of a run would differ.
  double scan_period_s() const { return timing_.scan_period_s; }

  PlantState<T> x;
  DriveState<T> s;
  Brake<T> brake;
  Report report;
  LoadEncoderParams<T> ring_encoder;
  EncoderFault<T> encoder;
  int sample_every = 0;         // drive cycles between two samples of a scan; 0: none are taken
  std::vector<Sample> samples;  // of the last scan
  T scans_done = T(0.0);        // numbers the readings of the ring encoder
  T count_offset = T(0.0);      // where the encoder is mounted on the shaft, counts; turns it has lost

 private:
  // Waves and wind at a drive cycle of the present scan.
  Anchor<T> here(int cycle) const {
    const T time = scans_done * T(timing_.scan_period_s) + T(cycle * timing_.cycle_s);
    return Anchor<T>(plant_.p, plant_.gear, plant_.second_gear, x, time);
  }

  GANTRY_INLINE void step(Anchor<T>& anchor, const MotorTorques<T>& u, T dt) {
    if (plant_.p.second_pinion)
      step_two(anchor, u, dt);
    else
      step_by_scheme<false>(anchor, u, dt);
  }

  // Not inlined, so that the loop of a plant with one pinion stays as short as it is.
  void step_two(Anchor<T>& anchor, MotorTorques<T> u, const T& dt) {
    if (plant_.p.lost_motor == 1) u.first = T(0.0);
    if (plant_.p.lost_motor == 2) u.second = T(0.0);
    step_by_scheme<true>(anchor, u, dt);
  }

  template <bool kTwo>
  GANTRY_INLINE void step_by_scheme(Anchor<T>& anchor, const MotorTorques<T>& u, T dt) {
    if (timing_.scheme == Scheme::kOneEvaluation)
      step_one_evaluation<kTwo>(plant_, current_, anchor, u, brake.closed, dt, x, report.torque_mesh);
    else
      step_runge_kutta<kTwo>(plant_, current_, anchor, u, brake.closed, dt, timing_.rk4_steps, x,
                             report.torque_mesh);
  }

  // Where a pinion meets the ring, and with which teeth.
  struct Place {
    T ring_angle;
    Pinion pinion;
  };
  Place first_place() const { return {x.pos_load - x.pos_base, Pinion::kFirst}; }
  Place second_place() const {
    return {(x.pos_load - x.pos_base) + plant_.p.second_angle_rad, Pinion::kSecond};
  }

  // Wind-up and gear error for a static mesh torque, by fixed-point iteration.
  void settle_gears(const GearError<T>& gear, const Train<T>& train, const Place& place, T torque_mesh,
                    T half_gap) {
    const PlantParams<T>& p = plant_.p;
    const T rho = x.pos_load - x.pos_base;
    const auto loaded = vabs(torque_mesh) > T(0.0);
    const T twist = sign(torque_mesh) * (plant_.windup(vabs(torque_mesh)) + select(loaded, half_gap, T(0.0)));
    T ring = p.gear_error ? gear.ring_error(place.ring_angle).error : T(0.0);
    if (p.tooth_pitch) ring = ring + ring_pitch_error(p, place.ring_angle).error;
    for (int k = 0; k < 50; ++k) {
      T em = p.gear_error ? gear.motor_error(train.pos_motor).error : T(0.0);
      if (p.tooth_pitch) em = em + pinion_pitch_error(p, train.pos_motor, place.pinion).error;
      train.pos_motor = p.ratio * (rho + twist - em - ring);
    }
  }

  // D(twist)/D(motor angle): 1/i and the slope of the gear error.
  T slope_at(const GearError<T>& gear, const Place& place, T pos_motor) const {
    const PlantParams<T>& p = plant_.p;
    T slope = plant_.ratio_inverse;
    if (p.gear_error) slope = slope + gear.motor_error(pos_motor).slope;
    if (p.tooth_pitch) slope = slope + pinion_pitch_error(p, pos_motor, place.pinion).slope;
    return slope;
  }

  T cogging_at(const GearError<T>& gear, T pos_motor) const {
    MotorWaves<T> waves(gear, pos_motor);
    return motor_side(plant_, gear, waves, pos_motor).cogging;
  }

  // Two pinions that hold a torque together: half each and the preload, all on the one whose motor has
  // torque, or on the first, whose brake holds. A motor that is not asked for its own torque is held by its
  // friction.
  void stand_on_two(T torque_mesh, const Thermal<T>& thermal, bool servo_on) {
    const PlantParams<T>& p = plant_.p;
    x.pos_motor_2 = x.pos_motor;
    x.motor_age_2 = x.motor_age;
    const T first_has = T(p.lost_motor != 1 ? 1.0 : 0.0);
    const T second_has = T(p.lost_motor != 2 ? 1.0 : 0.0);
    const T constant = p.thermal || p.torque_constant ? thermal.motor_torque : T(1.0);
    const bool share = servo_on && p.lost_motor == 0;
    const T preload = p.ratio * (constant * drive_.p.preload_nm);
    const bool on_first = !servo_on || p.lost_motor == 2;
    const T mesh_1 = share ? T(0.5) * torque_mesh + preload : on_first ? torque_mesh : T(0.0);
    const T mesh_2 = share ? T(0.5) * torque_mesh - preload : on_first ? T(0.0) : torque_mesh;
    settle_gears(plant_.gear, first_train(x), first_place(), mesh_1, thermal.half_backlash);
    settle_gears(plant_.second_gear, second_train(x), second_place(), mesh_2, thermal.half_backlash);
    // Of the motors; the slope of the gear error counts, 1 % of 1/i: of the preload it is 0.3 N m.
    T need_1 = mesh_1 * slope_at(plant_.gear, first_place(), x.pos_motor);
    T need_2 = mesh_2 * slope_at(plant_.second_gear, second_place(), x.pos_motor_2);
    if (p.cogging) {
      need_1 = need_1 - cogging_at(plant_.gear, x.pos_motor);
      need_2 = need_2 - cogging_at(plant_.second_gear, x.pos_motor_2);
    }
    report.torque_mesh = select(vabs(mesh_2) > vabs(mesh_1), mesh_2, mesh_1);
    if (servo_on) {
      // (u/2 + preload) of the first and (u/2 - preload) of the second, as far as they have torque, are
      // needed.
      const T living = first_has + second_has;
      const T u = T(2.0) *
                  ((first_has * need_1 + second_has * need_2) / constant -
                   drive_.p.preload_nm * (first_has - second_has)) /
                  living;
      const MotorTorques<T> given = shared(u, drive_.p.preload_nm, drive_.p.torque_max_nm);
      x.torque_motor = first_has * given.first;
      x.torque_motor_2 = second_has * given.second;
      s.torque_set = u;
      s.integral = u / drive_.p.kvp_nm_s_per_rad;
    } else {
      x.brake_z = -need_1 / plant_.brake.stiffness;
    }
    if (p.motor_friction) {
      if (servo_on) x.motor_z = (constant * x.torque_motor - need_1) / plant_.motor.stiffness;
      x.motor_z_2 = (constant * x.torque_motor_2 - need_2) / plant_.motor.stiffness;
    }
    s.pos_last = counted_position(drive_, x.pos_motor, x.vel_motor);
  }

  Sample sample() const {
    return {{x.pos_motor, x.vel_motor, x.pos_load, x.vel_load, torque_act(),
             select(brake.closed, T(1.0), T(0.0))}};
  }

  // Where the brake element begins when it closes: on a turning shaft it slips at once, its pre-sliding
  // length is passed in microseconds. Opened, it is gone.
  GANTRY_INLINE void grip_where(MaskOf<T> followed) {
    if (!any(followed)) return;
    const T slip = plant_.p.brake_presliding_rad * sign(x.vel_motor);
    const auto turning = vabs(x.vel_motor) * T(timing_.cycle_s) > plant_.p.brake_presliding_rad;
    x.brake_z = select(followed, select(both(brake.closed, turning), slip, T(0.0)), x.brake_z);
  }

  void flush() {
#define X(name, meaning) x.name = flush_subnormal(x.name);
    GANTRY_PLANT_STATE(X)
#undef X
#define X(name, effect, meaning) \
  if (plant_.p.effect) x.name = flush_subnormal(x.name);
    GANTRY_PLANT_EFFECT_STATE(X)
#undef X
    s.integral = flush_subnormal(s.integral);
    s.vel_filtered = flush_subnormal(s.vel_filtered);
    s.torque_set = flush_subnormal(s.torque_set);
  }

  Plant<T> plant_;
  Drive<T> drive_;
  CurrentLoop<T> current_;
  T close_cycles_;  // dead times of the brake, drive cycles
  T open_cycles_;
  Timing timing_;
  int cycles_per_anchor_;
};

}  // namespace gantry::GANTRY_ISA
