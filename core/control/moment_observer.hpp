// The eccentric moment from the motor torque of a moving axis: what it has become since the calibration.
//
// Torque balance at the gantry, as in the identification (z the direction of motion, T the motor torque):
//     i T = M(x) + J x'' + F_v x' + z (F + mu |M(x) + J x''|)
// Of the calibration M, J, F, F_v and mu are known. What is left over belongs to the moment and to friction:
//     y = i T - known = dMs sin x + dMc cos x + z dF
// Motion both ways tells friction from moment. dMs, dMc, dF are found by recursive least squares with fading
// memory: normal equations to which every scan of steady motion adds, and a prior (0 within the limit) that
// never fades.
#pragma once

#include "core/control/compensation.hpp"

namespace gantry::GANTRY_ISA {

constexpr double kAnyTorqueNm = 1e12;  // more, at the gantry, is no torque of an axis
constexpr double kTold = 2.0;          // standard deviations

template <class T>
T size_of(const Moment<T>& m) {
  return vsqrt(m.sine_nm * m.sine_nm + m.cosine_nm * m.cosine_nm);
}

// The sums without friction, which is eliminated: symmetric equations of the two parts of the moment. The
// prior keeps them positive definite.
template <class T>
struct MomentEquations {
  T sine, cross, cosine;
  T seen_sine, seen_cosine;
};

template <class T>
MomentEquations<T> moment_equations(const CompensationParams<T>& p, const CompensationState<T>& s) {
  const T prior = T(1.0) / (p.moment_limit_nm * p.moment_limit_nm);
  const T a33 = s.info_friction + T(1.0) / (p.friction_spread_nm * p.friction_spread_nm);
  const T u = s.info_sine_friction / a33, v = s.info_cosine_friction / a33;
  return {s.info_sine + prior - u * s.info_sine_friction, s.info_sine_cosine - u * s.info_cosine_friction,
          s.info_cosine + prior - v * s.info_cosine_friction, s.seen_sine - u * s.seen_friction,
          s.seen_cosine - v * s.seen_friction};
}

// What the sums say that the moment has become more than the calibration, N m at the gantry, whatever the
// limit.
template <class T>
Moment<T> moment_change(const CompensationParams<T>& p, const CompensationState<T>& s) {
  const MomentEquations<T> e = moment_equations(p, s);
  const T part = e.cross / e.cosine;
  const T sine = (e.seen_sine - part * e.seen_cosine) / (e.sine - part * e.cross);
  return {sine, (e.seen_cosine - e.cross * sine) / e.cosine};
}

// Whether a change of this kind, as large as the limit, would be kTold standard deviations. A short motion
// one way hardly tells moment, friction and the torque of acceleration from each other, which a slow scan
// reads too low, behind the step of its command: 5 deg at scans of 10 ms made 76 kN m of a sound machine.
template <class T>
MaskOf<T> moment_resolved(const CompensationParams<T>& p, const CompensationState<T>& s,
                          const Moment<T>& change) {
  const MomentEquations<T> e = moment_equations(p, s);
  const T cross = T(2.0) * e.cross * change.sine_nm * change.cosine_nm;
  const T squared =
      e.sine * change.sine_nm * change.sine_nm + cross + e.cosine * change.cosine_nm * change.cosine_nm;
  const T size = size_of(change);
  return squared * (p.moment_limit_nm * p.moment_limit_nm) >= T(kTold * kTold) * (size * size);
}

// The same of all friction.
template <class T>
T friction_change(const CompensationParams<T>& p, const CompensationState<T>& s) {
  const T a33 = s.info_friction + T(1.0) / (p.friction_spread_nm * p.friction_spread_nm);
  const Moment<T> m = moment_change(p, s);
  return (s.seen_friction - s.info_sine_friction * m.sine_nm - s.info_cosine_friction * m.cosine_nm) / a33;
}

// The moment that the laws use.
template <class T>
Moment<T> moment_now(const CompensationParams<T>& p, const CompensationState<T>& s) {
  if (!p.moment_observer) return {p.moment_sine_nm, p.moment_cosine_nm};
  return {p.moment_sine_nm + s.moment_sine_nm, p.moment_cosine_nm + s.moment_cosine_nm};
}

// The moment in use goes on towards what was seen, within the circle that a person has set, so slowly that no
// swing is excited, and only in the lanes that `follow`.
template <class T>
void use_moment(const CompensationParams<T>& p, const Moment<T>& seen, MaskOf<T> follow,
                CompensationState<T>& s) {
  const T size = size_of(seen);
  const T share = select(size > p.moment_limit_nm, p.moment_limit_nm / size, T(1.0));
  const T rate = select(follow, p.observer_rate, T(0.0));
  s.moment_sine_nm = s.moment_sine_nm + rate * (share * seen.sine_nm - s.moment_sine_nm);
  s.moment_cosine_nm = s.moment_cosine_nm + rate * (share * seen.cosine_nm - s.moment_cosine_nm);
}

// One scan: torque of the motor in this scan at set-point r. Nothing is added or followed at rest, while the
// direction turns round, while the load swings behind a stop that is harder than those of moves (its torque
// is no moment: the release of a key, 92 kN m on the improved gantry), or where the torque is no number.
// Returns the change that was seen, whatever the limit.
template <class T>
Moment<T> observe_moment(const CompensationParams<T>& p, T ratio, const SetPoint<T>& r, T torque_nm,
                         CompensationState<T>& s) {
  const SinCos<T> x = sincos(r.pos);
  const T z = sign(r.vel);
  const T inertia = p.inertia_kg_m2 * r.acc;
  const Moment<T> now = moment_now(p, s);
  const T transmitted = now.sine_nm * x.sin + now.cosine_nm * x.cos + inertia;
  const T friction = p.friction_nm + p.friction_load_ratio * vabs(transmitted);
  const T calibrated = p.moment_sine_nm * x.sin + p.moment_cosine_nm * x.cos;
  const T y = ratio * torque_nm - calibrated - inertia - p.friction_nm_s_per_rad * r.vel - z * friction;
  const auto steady = both(vabs(r.vel) > p.observer_speed_rad_s, s.direction * z == T(1.0));
  const auto planned = both(steady, s.swings_s <= T(0.0));
  const auto heard = both(planned, vabs(y) < T(kAnyTorqueNm));  // NaN is none
  const T w = select(heard, p.observer_weight, T(0.0));
  const T kept = select(heard, p.observer_memory, T(1.0));
  const T left = select(heard, y, T(0.0));
  s.info_sine = kept * s.info_sine + w * (x.sin * x.sin);
  s.info_cosine = kept * s.info_cosine + w * (x.cos * x.cos);
  s.info_friction = kept * s.info_friction + w;
  s.info_sine_cosine = kept * s.info_sine_cosine + w * (x.sin * x.cos);
  s.info_sine_friction = kept * s.info_sine_friction + w * (z * x.sin);
  s.info_cosine_friction = kept * s.info_cosine_friction + w * (z * x.cos);
  s.seen_sine = kept * s.seen_sine + w * (x.sin * left);
  s.seen_cosine = kept * s.seen_cosine + w * (x.cos * left);
  s.seen_friction = kept * s.seen_friction + w * (z * left);
  const Moment<T> change = moment_change(p, s);
  use_moment(p, change, heard, s);
  return change;
}

}  // namespace gantry::GANTRY_ISA
