// The position law with every compensation that is switched on. With all of them off it is `position_law`
// itself.
#pragma once

#include "core/control/lost_motion.hpp"
#include "core/control/position_law.hpp"

namespace gantry::GANTRY_ISA {

constexpr double kAnyAngleRad = 10.0;  // a reading beyond this is not an angle of a gantry
constexpr double kScansMissing = 3.0;  // in a row, that the engine bridges
constexpr double kStepShare = 0.01;    // of the swing's speed, for a reading that stepped

template <class T>
struct CompensatedResult {
  PositionLawResult<T> law;
  T torque_ff_nm;               // motor side, to be added to the drive's torque
  T disagreement_rad;           // load-side encoder minus the angle that motor encoder and maps give
  T moment_change_nm = T(0.0);  // of the eccentric moment since the calibration, as observed; 0 where it is
                                // not resolved
};

template <class T>
Flank<T> flank_now(const CompensationParams<T>& p, const CompensationState<T>& s) {
  const T friction = friction_load_now(p, s);
  const T gone = p.friction_load_nm - friction;
  return {backlash_now(p, s), p.flank_friction_share * friction, larger(gone, T(0.0))};
}

// Where the load is by motor encoder and maps, at rest: what the set-point starts from.
template <class T>
T resting_position(const PositionLawParams<T>& law, const CompensationParams<T>& p,
                   const CompensationState<T>& s, T counts) {
  const T zero = T(0.0);
  const T y = law.rad_per_count * counts / law.ratio;
  const Moment<T> moment = moment_now(p, s);
  const Flank<T> flank = flank_now(p, s);
  const T first = y - map_correction(p, moment, flank, s.direction, zero, y, zero, zero, zero).pos;
  return y - map_correction(p, moment, flank, s.direction, zero, first, zero, zero, zero).pos - s.bias_rad;
}

// Slow integral of the load-side error: bias' = K (r - y_load) outside the dead band, limited.
template <class T>
T load_side_bias(const CompensationParams<T>& p, T bias, T error) {
  const auto acts = negate(vabs(error) <= p.encoder_dead_band_rad);
  const T next = select(acts, bias + p.encoder_gain_per_s * error * p.period_s, bias);
  return clamp(next, -p.encoder_limit_rad, p.encoder_limit_rad);
}

// Twist without what the set-point plans, its wind-up and its flank: a load that is accelerated as planned
// does not swing.
template <class T>
T unplanned_twist(const CompensationParams<T>& p, const Moment<T>& m, const Flank<T>& flank, T direction,
                  const SetPoint<T>& r, T twist) {
  const T zero = T(0.0);
  return twist - windup_correction(p, m, r.pos, r.vel, r.acc, zero).pos -
         backlash_correction(p, m, flank, direction, zero, r.pos, r.vel, r.acc, zero).pos;
}

// Speed, at the gantry, by which the motor yields to the swing of the load: g (Kpp (w - r') + w1^2 (twist -
// resting twist)), w the filtered load speed, the twist without what is planned.
template <class T>
T damping_speed(const CompensationParams<T>& p, T kpp_per_s, CompensationState<T>& s, T ring, T vel_ref,
                T twist) {
  s.vel_ring_rad_s =
      s.vel_ring_rad_s + p.damping_filter * ((ring - s.ring_last_rad) / p.period_s - s.vel_ring_rad_s);
  s.twist_slow_rad = s.twist_slow_rad + p.damping_slow * (twist - s.twist_slow_rad);
  const T swing = p.swing_rad_s * p.swing_rad_s * (twist - s.twist_slow_rad);
  return p.damping_gain * (kpp_per_s * (s.vel_ring_rad_s - vel_ref) + swing);
}

// First scan after the axis began to follow, in the lanes where it is; direction, bias and what was observed
// are kept, they describe the machine.
template <class T>
void begin_following(const CompensationParams<T>& p, const Moment<T>& m, const Flank<T>& flank, T ratio,
                     const SetPoint<T>& r, T y, T ring, CompensationState<T>& s) {
  const auto going = s.started;
  s.pos_last_rad = select(going, s.pos_last_rad, r.pos);
  s.acc_last_rad_s2 = select(going, s.acc_last_rad_s2, r.acc);
  s.ring_last_rad = select(going, s.ring_last_rad, ring);
  s.vel_ring_rad_s = select(going, s.vel_ring_rad_s, r.vel);
  s.twist_slow_rad = select(going, s.twist_slow_rad, unplanned_twist(p, m, flank, s.direction, r, y - ring));
  s.torque_zero_nm = select(going, s.torque_zero_nm, feed_forward_torque(p, ratio, r.pos, r.acc));
  s.started = mask<T>(true);
}

// Own errors of the load-side encoder by its map. The map was measured from outside, so it holds how the base
// leans under the eccentric moment of that day; what the moment has become since leans it further.
template <class T>
T own_errors(const CompensationParams<T>& p, const CompensationState<T>& s, T ring) {
  const T mapped = harmonics(p.scale, ring).value;
  if (!p.moment_observer) return mapped;
  const Moment<T> change{s.moment_sine_nm, s.moment_cosine_nm};
  return mapped + p.lean_rad_per_nm * holding_moment(change, ring).value;
}

// What the load-side encoder says without its own errors, and what the law takes of it. The load goes with
// its set-point but for its swing, and some scans may be missing. What goes on faster is a step of the
// encoder: it is taken so slowly that it is no step of the command. An invalid reading (NaN, or no angle of a
// gantry) is replaced by dead reckoning.
template <class T>
struct LoadSideReading {
  T seen;  // NaN or no angle of a gantry where the encoder shows none
  T taken;
};

template <class T>
LoadSideReading<T> load_side_reading(const CompensationParams<T>& p, const CompensationState<T>& s, T ring,
                                     T lead, T vel_ref, T y) {
  const T seen = (p.scale_map ? ring - own_errors(p, s, ring) : ring) + lead;
  const auto valid = vabs(ring) < T(kAnyAngleRad);
  const T way = vel_ref * p.period_s;
  const T reckoned = s.ring_last_rad + way;
  const T swing = p.swing_speed_max_rad_s * p.period_s;
  const auto plausible = vabs(seen - reckoned) <= swing + T(kScansMissing) * vabs(way);
  const T most = select(plausible, swing, T(kStepShare) * swing);
  const T followed = select(valid, clamp(seen, reckoned - most, reckoned + most), reckoned);
  return {select(valid, seen, ring), select(s.started, followed, select(valid, seen, y))};
}

// One scan. counts: motor encoder minus its zero offset; ring: load-side encoder, rad (0 without one);
// torque_nm: of the motor.
// NaN of the motor side passes through to the command on purpose, as in position_law.
template <class T>
CompensatedResult<T> compensated_law(const PositionLawParams<T>& law, const CompensationParams<T>& p,
                                     CompensationState<T>& s, const SetPoint<T>& r, T counts, T ring,
                                     T torque_nm) {
  const T ratio = law.ratio;
  const T lead = r.vel * p.latency_s;  // how far the motor went on since its encoder was read
  const T y = law.rad_per_count * counts / ratio + lead;
  // Both encoders are latched at the same instant.
  const LoadSideReading<T> reading = load_side_reading(p, s, ring, lead, r.vel, y);
  ring = reading.taken;
  const Moment<T> moment = moment_now(p, s);
  const Flank<T> flank = flank_now(p, s);
  const MaskOf<T> going = s.started;
  if (any(negate(going))) begin_following(p, moment, flank, ratio, r, y, ring, s);

  const T before = s.direction;
  const T way = (r.pos - s.pos_last_rad) / p.reversal_length_rad;
  s.direction = clamp(before + way, T(-1.0), T(1.0));
  const T turning = (s.direction - before) / p.period_s;
  // A key that is let go stops with a jerk that no move has: followed, it would drive the motor through the
  // backlash with all of its torque (371 N m of 385 on the improved gantry) for an accuracy that nobody asks
  // of a stop.
  const T asked = (r.acc - s.acc_last_rad_s2) / p.period_s;
  const T jerk = clamp(asked, -p.jerk_max_rad_s3, p.jerk_max_rad_s3);
  s.swings_s = select(asked == jerk, larger(s.swings_s - p.period_s, T(0.0)), p.observer_calm_s);
  const Motion<T> c = map_correction(p, moment, flank, s.direction, turning, r.pos, r.vel, r.acc, jerk);
  if (p.load_encoder) s.bias_rad = load_side_bias(p, s.bias_rad, r.pos - ring);

  const T shift = c.pos + s.bias_rad;
  CompensatedResult<T> out;
  out.law = position_law(law, r.pos + shift - lead, r.vel + c.vel, counts);
  out.law.pos_act_rad = out.law.pos_act_rad + lead - shift;
  if (p.damping) {
    const T twist = unplanned_twist(p, moment, flank, s.direction, r, y - ring);
    const T yields = ratio * damping_speed(p, law.kpp_per_s, s, ring, r.vel, twist);
    out.law.vel_cmd_rad_s = clamp(out.law.vel_cmd_rad_s - yields, -law.vel_max_rad_s, law.vel_max_rad_s);
  }
  const T torque = feed_forward_torque(p, ratio, r.pos, r.acc) - s.torque_zero_nm;
  out.torque_ff_nm = clamp(torque, -p.torque_limit_nm, p.torque_limit_nm);
  out.disagreement_rad = reading.seen - (y - c.pos);
  if (p.moment_observer) {
    const Moment<T> change = observe_moment(p, ratio, r, torque_nm, s);
    out.moment_change_nm = select(moment_resolved(p, s, change), size_of(change), T(0.0));
  }
  if (p.backlash_observer && p.load_encoder) {
    observe_lost_motion(p, moment, r, out.disagreement_rad, s);
    use_lost_motion(p, moment, flank, r, s);
  } else if (p.backlash_observer) {
    const T x = y - gear_correction(p, r.pos, r.vel).pos;
    observe_backlash(p, ratio, r, x, torque_nm, going, s);
  }
  s.pos_last_rad = r.pos;
  s.acc_last_rad_s2 = r.acc;
  s.ring_last_rad = ring;
  return out;
}

// Parameters and state of one axis; `before` is the state ahead of this scan, for a scan that is done again
// because its set-point changed.
template <class T>
struct Compensation {
  CompensationParams<T> p;
  CompensationState<T> s;
  CompensationState<T> before;
};

}  // namespace gantry::GANTRY_ISA
