// The servo drive: speed PI at 125 us with anti-windup, torque limit with I2t, quick-stop ramp, encoder
// evaluation. It is hardware to the controller; plant equations S7 give the order of operations.
#pragma once

#include "core/lane/elementary.hpp"

namespace gantry::GANTRY_ISA {

enum class DriveMode { kOff, kSpeed, kQuickStop };

// clang-format off
#define GANTRY_DRIVE_PARAMS(X)                                                                         \
  X(cycle_s, 125e-6, "drive cycle Ts")                                                                 \
  X(kvp_nm_s_per_rad, 0.0, "speed loop gain")                                                          \
  X(tvi_s, 1.0, "speed loop integral time")                                                            \
  X(torque_rated_nm, 1.0, "drawn continuously")                                                            \
  X(torque_max_nm, 1.0, "drawn for overload_time_s, object 6072")                                      \
  X(overload_time_s, 60.0, "from cold at torque_max_nm until the limit falls to torque_rated_nm")      \
  X(vel_max_rad_s, 1e9, "speed ceiling, at the motor, object 6080")                                    \
  X(quick_dec_rad_s2, 1.0, "quick-stop deceleration, at the motor, object 6085")                       \
  X(speed_count_rad, 0.0, "resolution of the speed feedback, at the motor; 0: ideal")                  \
  X(position_count_rad, 0.0, "resolution of the reported position, at the motor; 0: ideal")            \
  X(latency_s, 0.0, "age of an encoder reading")                                                       \
  X(speed_filter, 0.0, "first-order filter of the speed feedback: exp(-Ts/T); 0: none")                \
  X(brake_close_s, 0.0, "dead time until the brake has its torque")                                    \
  X(brake_open_s, 0.0, "time from the command until the brake is free")                                \
  X(encoder_lines, 1.0, "signal periods of the encoder per turn")                                      \
  X(encoder_error_1x_rad, 0.0, "its error, one wave per signal period, at the motor")                  \
  X(encoder_error_2x_rad, 0.0, "two waves per signal period")                                          \
  X(encoder_eccentricity_rad, 0.0, "one wave per turn")                                                \
  X(encoder_eccentricity_phase_rad, 0.0, "phase of it")                                                \
  X(preload_nm, 0.0, "torque of two motors against each other: one has it more, the other less")

#define GANTRY_DRIVE_STATE(X)                                                                          \
  X(integral, "I of the speed loop, rad/s")                                                           \
  X(pos_last, "last encoder evaluation, rad")                                                         \
  X(vel_filtered, "filtered speed feedback, rad/s")                                                   \
  X(torque_set, "u of the last cycle, N m")                                                           \
  X(ramp, "speed set-point of the quick-stop ramp, rad/s")                                            \
  X(overload, "I2t account, (T/T_rated)^2 s")
// clang-format on

template <class T>
struct DriveParams {
#define X(name, value, meaning) T name = T(value);
  GANTRY_DRIVE_PARAMS(X)
#undef X
  bool encoder_errors = false;
  int delay_cycles = 0;     // 0 or 1: the torque acts in the cycle after the one that computed it
  bool two_motors = false;  // of the plant: GantrySim sets it
};

// What the motors of an axis are asked for; without a second one `second` is 0.
template <class T>
struct MotorTorques {
  T first;
  T second;
};

// Parameters and what follows from them, computed once.
template <class T>
struct Drive {
  DriveParams<T> p;
  T cycle_inverse;         // 1/Ts
  T integral_step;         // Ts/Tvi
  T speed_fresh;           // 1 - speed_filter
  T speed_count_inverse;   // 1/count of the speed feedback; not looked at where it is ideal
  T rated_inverse;         // 1/T_rated
  T budget_s;              // I2t account at which the limit falls
  T torque_continuous_nm;  // the limit then

  Drive() : Drive(DriveParams<T>()) {}
  explicit Drive(const DriveParams<T>& params) : p(params) {
    cycle_inverse = T(1.0) / p.cycle_s;
    integral_step = p.cycle_s / p.tvi_s;
    speed_fresh = T(1.0) - p.speed_filter;
    speed_count_inverse = T(1.0) / p.speed_count_rad;
    rated_inverse = T(1.0) / p.torque_rated_nm;
    const T ratio = p.torque_max_nm * rated_inverse;
    budget_s = (ratio * ratio - T(1.0)) * p.overload_time_s;
    torque_continuous_nm = smaller(p.torque_max_nm, p.torque_rated_nm);
  }
};

template <class T>
struct DriveState {
#define X(name, meaning) T name = T(0.0);
  GANTRY_DRIVE_STATE(X)
#undef X
};

// What a drive is told; in a pack each in its own mode.
template <class T>
struct DriveCommand {
  MaskOf<T> off = mask<T>(true);
  MaskOf<T> quick_stop = mask<T>(false);
  T vel_cmd_rad_s = T(0.0);  // at the motor
  T torque_ff_nm = T(0.0);   // added to the output of the speed loop

  DriveCommand() = default;
  DriveCommand(DriveMode mode, T vel_cmd, T torque_ff)
      : off(mask<T>(mode == DriveMode::kOff)),
        quick_stop(mask<T>(mode == DriveMode::kQuickStop)),
        vel_cmd_rad_s(vel_cmd),
        torque_ff_nm(torque_ff) {}
};

// Error of the encoder at an angle: its disc off the axis, and sine and cosine tracks out of shape
// (offset: one wave per signal period; amplitudes and quadrature: two; Heydemann 1981). Whole turns and
// periods are taken off first: sine and cosine want a small argument.
template <class T>
T encoder_error(const DriveParams<T>& p, T pos) {
  constexpr double kTurn = 6.283185307179586;
  const T turns = pos * T(1.0 / kTurn);
  const T periods = turns * p.encoder_lines;
  const SinCos<T> turn = sincos((turns - vround(turns)) * T(kTurn) + p.encoder_eccentricity_phase_rad);
  const SinCos<T> period = sincos((periods - vround(periods)) * T(kTurn));
  return p.encoder_eccentricity_rad * turn.sin + p.encoder_error_1x_rad * period.sin +
         p.encoder_error_2x_rad * twice(period).sin;
}

// Position as the encoder sees it, `latency_s` old.
template <class T>
GANTRY_INLINE T encoder_position(const DriveParams<T>& p, T pos_motor, T vel_motor) {
  const T pos = pos_motor - vel_motor * p.latency_s;
  return p.encoder_errors ? pos + encoder_error(p, pos) : pos;
}

// The same in whole counts of the speed feedback (0: ideal).
template <class T>
GANTRY_INLINE T counted_position(const Drive<T>& drive, T pos_motor, T vel_motor) {
  const T pos = encoder_position(drive.p, pos_motor, vel_motor);
  const auto real = drive.p.speed_count_rad > T(0.0);
  return select(real, drive.p.speed_count_rad * vround(pos * drive.speed_count_inverse), pos);
}

// Speed feedback by backward difference of the encoder over one cycle, filtered if asked for.
template <class T>
GANTRY_INLINE T speed_feedback(const Drive<T>& drive, DriveState<T>& s, T pos_motor, T vel_motor) {
  const T pos = counted_position(drive, pos_motor, vel_motor);
  const T raw = (pos - s.pos_last) * drive.cycle_inverse;
  s.pos_last = pos;
  s.vel_filtered = raw * drive.speed_fresh + s.vel_filtered * drive.p.speed_filter;
  return s.vel_filtered;
}

// Two motors behind one speed loop (plant equations S15): each has half of the torque u of the loop, one with
// the preload, the other against it, and each its own limit.
template <class T>
MotorTorques<T> shared(const T& u, const T& preload, const T& limit) {
  const T half = T(0.5) * u;
  return {clamp(half + preload, -limit, limit), clamp(half - preload, -limit, limit)};
}

// Torque of the one that has more.
template <class T>
T larger_share(const DriveParams<T>& p, const T& u) {
  return smaller(T(0.5) * vabs(u) + vabs(p.preload_nm), p.torque_max_nm);
}

// u at which both have their limit.
template <class T>
T limit_of_two(const DriveParams<T>& p, const T& limit) {
  return T(2.0) * (limit + vabs(p.preload_nm));
}

// Torque limit of a motor now; while more than the rated torque flows the account grows, below it shrinks. Of
// two motors the account is that of the one with the larger share, which is nothing while the drive is off.
template <class T>
GANTRY_INLINE T torque_limit(const Drive<T>& drive, MaskOf<T> off, DriveState<T>& s) {
  const T flows =
      drive.p.two_motors ? select(off, T(0.0), larger_share(drive.p, s.torque_set)) : s.torque_set;
  const T load = flows * drive.rated_inverse;
  s.overload = clamp(s.overload + (load * load - T(1.0)) * drive.p.cycle_s, T(0.0), drive.budget_s);
  return select(s.overload < drive.budget_s, drive.p.torque_max_nm, drive.torque_continuous_nm);
}

// One drive cycle; returns what acts now. `limited` becomes true where the torque limit of a motor acts.
template <class T>
GANTRY_INLINE MotorTorques<T> drive_cycle(const Drive<T>& drive, const DriveCommand<T>& command,
                                          DriveState<T>& s, T pos_motor, T vel_motor, MaskOf<T>& limited) {
  const DriveParams<T>& p = drive.p;
  const T vel = speed_feedback(drive, s, pos_motor, vel_motor);
  const T limit = torque_limit(drive, command.off, s);
  T ramp = clamp(command.vel_cmd_rad_s, -p.vel_max_rad_s, p.vel_max_rad_s);
  if (any(command.quick_stop)) {
    const T step = p.quick_dec_rad_s2 * p.cycle_s;
    const T slower = select(vabs(s.ramp) > step, s.ramp - sign(s.ramp) * step, T(0.0));
    ramp = select(command.quick_stop, slower, ramp);
  }
  const T error = ramp - vel;
  const T wanted = p.kvp_nm_s_per_rad * error + (p.kvp_nm_s_per_rad * s.integral + command.torque_ff_nm);
  const T most = p.two_motors ? limit_of_two(p, limit) : limit;
  T given = clamp(wanted, -most, most);
  const auto whole = given == wanted;
  const auto free = either(whole, (wanted - given) * error < T(0.0));
  T integral = select(free, s.integral + error * drive.integral_step, s.integral);
  auto cut = negate(whole);
  if (p.two_motors) cut = either(cut, T(0.5) * vabs(given) + vabs(p.preload_nm) > limit);
  T acting = p.delay_cycles > 0 ? s.torque_set : given;
  if (any(command.off)) {
    ramp = select(command.off, vel, ramp);
    integral = select(command.off, T(0.0), integral);
    given = select(command.off, T(0.0), given);
    acting = select(command.off, T(0.0), acting);
    cut = both(cut, negate(command.off));
  }
  limited = either(limited, cut);
  s.ramp = ramp;
  s.integral = integral;
  s.torque_set = given;
  if (p.two_motors) return shared(acting, select(command.off, T(0.0), p.preload_nm), limit);
  return {acting, T(0.0)};
}

}  // namespace gantry::GANTRY_ISA
