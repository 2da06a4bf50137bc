// What the controller knows about its machine from measurements, and the corrections that follow from it.
// Every number comes from the calibration file; nothing here knows the plant.
// docs/explanation/compensation.md derives each law; signs: a correction is what the motor must lead the load
// by, at the gantry.
#pragma once

#include <array>
#include <cstddef>

#include "core/control/harmonics.hpp"
#include "core/control/segments.hpp"

namespace gantry::GANTRY_ISA {

// As many as show the pitch of each tooth of a ring of 384: two a tooth.
constexpr int kMapHarmonics = 192;
constexpr int kReversalHarmonics = 12;
constexpr int kScaleHarmonics = 40;
constexpr int kFastWaves = 12;

// clang-format off
#define GANTRY_COMPENSATION_SWITCHES(X)                                                               \
  X(torque_eccentric, "motor torque that carries the eccentric moment, fed forward")                  \
  X(torque_acceleration, "motor torque that accelerates, fed forward")                                \
  X(gear_map, "gear error, from the map")                                                             \
  X(windup, "wind-up of the transmission under eccentric moment and acceleration")                    \
  X(reversal, "lost motion: friction wind-up by direction, backlash by the torque in the mesh")       \
  X(load_encoder, "slow integral of the load-side error")                                             \
  X(scale_map, "errors of the load-side encoder itself, from its map")                                \
  X(damping, "load swing damped through the load-side encoder")                                       \
  X(moment_observer, "what the eccentric moment has become, from the motor torque")                   \
  X(backlash_observer, "what the backlash has become, from the motor torque or the load-side encoder")

#define GANTRY_COMPENSATION_PARAMS(X)                                                                 \
  X(period_s, 1e-3, "scan period")                                                                    \
  X(moment_sine_nm, 0.0, "load torque to hold: moment_sine sin(angle) + moment_cosine cos(angle)")    \
  X(moment_cosine_nm, 0.0, "see moment_sine_nm")                                                      \
  X(inertia_kg_m2, 0.0, "load and motor, at the gantry")                                              \
  X(torque_limit_nm, 0.0, "largest torque fed forward, motor side")                                   \
  X(compliance_rad_per_nm, 0.0, "wind-up per load torque, 1/k")                                       \
  X(lean_rad_per_nm, 0.0, "of the base, per load torque: an encoder on the ring does not see it") \
  X(windup_per_acc_s2, 0.0, "wind-up per acceleration of the load, J/k")                              \
  X(jerk_max_rad_s3, 1e9, "largest jerk of the set-point whose wind-up is followed")                  \
  X(reversal_length_rad, 1e-4, "way over which the direction turns round")                            \
  X(backlash_rad, 0.0, "backlash, both flanks together, at the gantry")                               \
  X(friction_load_nm, 0.0, "friction behind the mesh")                                                \
  X(flank_friction_share, 1.0, "of it, with which the flank of the gears is planned")                 \
  X(inertia_load_kg_m2, 0.0, "behind the mesh")                                                       \
  X(flank_nm, 1.0, "torque in the flank, on either side of 0, over which the flank changes")           \
  X(fade_rad_s, 1e9, "waves passing faster than this are no longer followed")                         \
  X(pos_limit_rad, 0.0, "largest correction of all maps together")                                    \
  X(encoder_gain_per_s, 0.0, "integral gain of the load-side loop")                                   \
  X(encoder_dead_band_rad, 0.0, "load-side errors below this are left alone")                         \
  X(encoder_limit_rad, 0.0, "largest correction of the load-side loop")                               \
  X(swing_speed_max_rad_s, 1e9, "fastest that the load moves against its set-point")                  \
  X(damping_gain, 0.0, "part of the swing torque that the motor yields to")                           \
  X(swing_rad_s, 0.0, "first mode with the motor held")                                               \
  X(damping_filter, 1.0, "1 - exp(-Ts/T) of the load speed")                                          \
  X(damping_slow, 0.0, "1 - exp(-Ts/T) of the resting twist")                                         \
  X(latency_s, 0.0, "age of a motor encoder reading")                                                 \
  X(friction_nm, 0.0, "Coulomb friction, motor and rollers together")                                 \
  X(friction_load_ratio, 0.0, "part of the transmitted torque that is lost beside it")                \
  X(friction_nm_s_per_rad, 0.0, "its growth with speed")                                              \
  X(friction_spread_nm, 1.0, "what friction may change by, standard deviation")                       \
  X(moment_limit_nm, 1.0, "largest change of the eccentric moment that is followed")                  \
  X(observer_speed_rad_s, 0.0, "slower motion says nothing about the moment")                         \
  X(observer_weight, 0.0, "of the torque of one scan, 1/(N m)^2")                                     \
  X(observer_memory, 1.0, "exp(-Ts/T) of what was seen in motion")                                    \
  X(observer_calm_s, 0.0, "until the load has swung out behind a jerk that is larger than jerk_max")  \
  X(observer_rate, 0.0, "1 - exp(-Ts/T) of the moment in use")                                        \
  X(backlash_step_rad, 1.0, "backlash from one model of the bank to the next")                        \
  X(backlash_held_rad, 0.0, "backlash that maps and backlash_rad were identified with")               \
  X(backlash_memory, 1.0, "exp(-Ts/T) of what was seen in motion")                                    \
  X(backlash_fast, 0.0, "1 - exp(-Ts/T) of torques faster than the swing")                            \
  X(backlash_slow, 0.0, "1 - exp(-Ts/T) of torques slower than the swing")

#define GANTRY_COMPENSATION_STATE(X)                                                                  \
  X(direction, "of the last motion, -1..1")                                                           \
  X(bias_rad, "correction of the load-side loop")                                                     \
  X(pos_last_rad, "set-point of the last scan")                                                       \
  X(acc_last_rad_s2, "acceleration of the set-point in the last scan")                                \
  X(ring_last_rad, "load-side reading of the last scan")                                              \
  X(vel_ring_rad_s, "load speed, filtered")                                                           \
  X(twist_slow_rad, "resting twist")                                                                  \
  X(torque_zero_nm, "feed-forward torque where the axis began to follow")                             \
  X(moment_sine_nm, "change of the moment that is in use")                                            \
  X(moment_cosine_nm, "see moment_sine_nm")                                                           \
  X(info_sine, "sums of the moment observer: weighted products of the columns")                       \
  X(info_cosine, "see info_sine")                                                                     \
  X(info_friction, "see info_sine")                                                                   \
  X(info_sine_cosine, "see info_sine")                                                                \
  X(info_sine_friction, "see info_sine")                                                              \
  X(info_cosine_friction, "see info_sine")                                                            \
  X(seen_sine, "sums of the moment observer: columns with the torque left over")                      \
  X(seen_cosine, "see seen_sine")                                                                     \
  X(seen_friction, "see seen_sine")                                                                   \
  X(swings_s, "of observer_calm_s, what is left")                                                     \
  X(backlash_change_rad, "change of the backlash that is in use")                                     \
  X(friction_change_nm, "change of all friction that the backlash observer uses")                     \
  X(motor_last_rad, "motor angle less gear error of the last scan, at the gantry")                    \
  X(motor_vel_rad_s, "its speed")  \
  X(moved, "1 where the set-point moved in the last scan")

#define GANTRY_LOAD_MODEL_STATE(X)                                                                    \
  X(twist_rad, "motor before load")                                                                   \
  X(vel_rad_s, "of the load")                                                                         \
  X(fast_nm, "torque that the model leaves, filtered once")                                           \
  X(smooth_nm, "filtered twice")                                                                      \
  X(slow_nm, "what of it changes slowly")                                                             \
  X(misfit, "sum of squares of the rest, in variances")
// clang-format on

// A load behind the gears of one backlash: backlash_observer.hpp.
template <class T>
struct LoadModel {
#define X(name, meaning) T name = T(0.0);
  GANTRY_LOAD_MODEL_STATE(X)
#undef X
};

// Backlash 0, 1, 2 ... steps: a parabola between them errs by less than a tenth of a step.
constexpr int kBacklashModels = 8;

// Mean, sine, cosine, direction, flank, and the lead that they explain: lost_motion.hpp.
constexpr int kLeadColumns = 6;
constexpr std::size_t kLeadSums = kLeadColumns * (kLeadColumns + 1) / 2;

template <class T>
struct CompensationParams {
#define X(name, meaning) bool name = false;
  GANTRY_COMPENSATION_SWITCHES(X)
#undef X
#define X(name, value, meaning) T name = T(value);
  GANTRY_COMPENSATION_PARAMS(X)
#undef X
  Harmonics<T, kMapHarmonics> map;
  Harmonics<T, kReversalHarmonics> lost_motion;
  Harmonics<T, kScaleHarmonics> scale;
  std::array<FastWave<T>, kFastWaves> fast{};
  int fast_used = kFastWaves;  // the others are 0
};

template <class T>
struct CompensationState {
#define X(name, meaning) T name = T(0.0);
  GANTRY_COMPENSATION_STATE(X)
#undef X
  std::array<LoadModel<T>, kBacklashModels> bank{};
  std::array<T, kLeadSums> lead_sums{};  // products of the columns, upper triangle row by row
  MaskOf<T> started = mask<T>(false);
};

// What the flank of the gears is planned with, as far as it is followed.
template <class T>
struct Flank {
  T backlash_rad;
  T friction_nm;  // behind the mesh
  T gone_nm;      // of that friction, since the calibration; 0 where it has grown
};

template <class T>
struct Motion {
  T pos;
  T vel;
};

// Load torque to hold: sine sin(angle) + cosine cos(angle), at the gantry.
template <class T>
struct Moment {
  T sine_nm;
  T cosine_nm;
};

// Load torque that the eccentric moment asks for.
template <class T>
Curve<T> holding_moment(const Moment<T>& m, T pos) {
  const SinCos<T> s = sincos(pos);
  return {m.sine_nm * s.sin + m.cosine_nm * s.cos, m.sine_nm * s.cos - m.cosine_nm * s.sin};
}

// Gear map: ring harmonics and fast waves. A wave that passes with w = cycles x speed counts 1/(1 +
// (w/fade)^4): above that the motor would need more torque than the wave is worth.
template <class T>
Motion<T> gear_correction(const CompensationParams<T>& p, T pos, T vel) {
  const Curve<T> slow = harmonics(p.map, pos);
  Motion<T> c{slow.value, slow.slope * vel};
  for (int k = 0; k < p.fast_used; ++k) {
    const FastWave<T>& wave = p.fast[static_cast<std::size_t>(k)];
    const Curve<T> w = fast_wave(wave, pos);
    const T passing = wave.cycles * vel / p.fade_rad_s;
    const T squared = passing * passing;
    const T share = T(1.0) / (T(1.0) + squared * squared);
    c.pos = c.pos + share * w.value;
    c.vel = c.vel + share * w.slope * vel;
  }
  return c;
}

// Wind-up (M(r) + J r'')/k, its speed by M'(r) r' and the jerk of the set-point.
template <class T>
Motion<T> windup_correction(const CompensationParams<T>& p, const Moment<T>& m, T pos, T vel, T acc, T jerk) {
  const Curve<T> held = holding_moment(m, pos);
  return {p.compliance_rad_per_nm * held.value + p.windup_per_acc_s2 * acc,
          p.compliance_rad_per_nm * held.slope * vel + p.windup_per_acc_s2 * jerk};
}

// Half the backlash, on the flank that the mesh torque of the set-point asks for: Tg = M(r) + z F + J r''.
// s(u) = u (3 - u^2)/2 for |u| < 1, u = Tg / flank_nm: its ends have no step of the speed.
template <class T>
Motion<T> backlash_correction(const CompensationParams<T>& p, const Moment<T>& m, const Flank<T>& flank,
                              T direction, T turning, T pos, T vel, T acc, T jerk) {
  const Curve<T> held = holding_moment(m, pos);
  const T torque = held.value + direction * flank.friction_nm + p.inertia_load_kg_m2 * acc;
  const T rate = held.slope * vel + turning * flank.friction_nm + p.inertia_load_kg_m2 * jerk;
  const T u = clamp(torque / p.flank_nm, T(-1.0), T(1.0));
  const T half = T(0.5) * flank.backlash_rad;
  return {half * (T(0.5) * u * (T(3.0) - u * u)), half * (T(1.5) * (T(1.0) - u * u)) * (rate / p.flank_nm)};
}

// Half of what the motor goes further one way than the other, less the wind-up of friction that is gone: no
// more holds a load that has come to rest. Friction that has grown need not hold it by more.
template <class T>
Curve<T> lost_motion(const CompensationParams<T>& p, const Flank<T>& flank, T pos) {
  const Curve<T> mapped = harmonics(p.lost_motion, pos);
  return {mapped.value - p.compliance_rad_per_nm * flank.gone_nm, mapped.slope};
}

// All maps at a set-point; limited, and standing still where it is limited.
template <class T>
Motion<T> map_correction(const CompensationParams<T>& p, const Moment<T>& m, const Flank<T>& flank,
                         T direction, T turning, T pos, T vel, T acc, T jerk) {
  Motion<T> c{T(0.0), T(0.0)};
  const auto add = [&c](const Motion<T>& more) {
    c.pos = c.pos + more.pos;
    c.vel = c.vel + more.vel;
  };
  if (p.gear_map) add(gear_correction(p, pos, vel));
  if (p.windup) add(windup_correction(p, m, pos, vel, acc, jerk));
  if (p.reversal) {
    const Curve<T> lost = lost_motion(p, flank, pos);
    add({direction * lost.value, direction * lost.slope * vel + turning * lost.value});
    add(backlash_correction(p, m, flank, direction, turning, pos, vel, acc, jerk));
  }
  const T limited = clamp(c.pos, -p.pos_limit_rad, p.pos_limit_rad);
  return {limited, select(limited == c.pos, c.vel, T(0.0) * c.pos)};
}

// Motor torque fed forward: eccentric moment and acceleration, through the ratio. The moment is that of the
// calibration: of one that is being learnt the integrator of the drive takes what is more.
template <class T>
T feed_forward_torque(const CompensationParams<T>& p, T ratio, T pos, T acc) {
  T torque = T(0.0);
  const Moment<T> calibrated{p.moment_sine_nm, p.moment_cosine_nm};
  if (p.torque_eccentric) torque = torque + holding_moment(calibrated, pos).value / ratio;
  if (p.torque_acceleration) torque = torque + p.inertia_kg_m2 * acc / ratio;
  return torque;
}

}  // namespace gantry::GANTRY_ISA
