// The backlash from the motor torque of an axis whose gears change their flank and whose load no encoder
// sees; with one on the ring lost_motion.hpp has it.
//
// A bank of models of the load, each with another backlash b. All are driven by the motor angle that is
// measured, x, less the gear error; k, J, M, F are those of the calibration and of the moment observer:
//     J w' = Tg - M(r) - F sign(w)       twist' = x' - w       Tg = k d + c d',  d what the twist is beyond
//     +-b/2
// A load that has passed the gap in a model and not on the machine, or later, makes another torque at the
// motor:
//     e = i T - i^2 Jm x'' - z F_m - Tg (1 + mu z sign Tg)
// What of e changes as fast as the load swings, e', is no error of moment or friction. It leads the model
// back to the machine, as in every observer, and the sum of its squares says how badly a model fits (multiple
// models, Magill 1965). The backlash is where the parabola through the three best sums has its lowest point.
// A planned torque near 0 tells nothing: whether the gap is crossed there depends on the friction, which
// holds a load that begins to move by anything between all of it either way.
#pragma once

#include "core/control/moment_observer.hpp"

namespace gantry::GANTRY_ISA {

constexpr double kMeshDamping = 0.02;  // of the swing, structural: with 0.04 the backlash found is 5 % larger
constexpr double kModelFollows =
    0.5;  // of the swing per radian: an observer with a quarter of critical damping
constexpr double kMomentKnown =
    0.5;  // of the friction behind the mesh: nearer than that the moment in use is known
constexpr double kFlankClear =
    2.0;  // of the friction behind the mesh: nearer to 0 a planned torque may cross the gap or not
constexpr double kAnyMotorRad = 1e4;  // of the motor, at the gantry: more is no angle
constexpr double kAnyStepRad = 1e-2;  // of the motor in a scan, at the gantry: more is no motion of a gantry

// What all models have in common in a scan.
template <class T>
struct LoadInputs {
  T step_rad;     // way of the motor
  T vel_rad_s;    // of the motor
  T torque_nm;    // of the motor at the mesh, without what accelerates and what rubs before it
  T moment_nm;    // that the load asks for
  T friction_nm;  // behind the mesh
  T direction;    // of the set-point: -1, 0, 1
};

// Friction behind the mesh, as the moment observer sees it.
template <class T>
T friction_load_now(const CompensationParams<T>& p, const CompensationState<T>& s) {
  if (!p.backlash_observer) return p.friction_load_nm;
  return p.friction_load_nm * (T(1.0) + s.friction_change_nm / p.friction_nm);
}

// The backlash that the laws use.
template <class T>
T backlash_now(const CompensationParams<T>& p, const CompensationState<T>& s) {
  return p.backlash_observer ? p.backlash_rad + s.backlash_change_rad : p.backlash_rad;
}

template <class T>
T stiffness_of(const CompensationParams<T>& p) {
  return p.inertia_load_kg_m2 / p.windup_per_acc_s2;
}

// Torque of the mesh: a spring with a gap, which cannot pull.
template <class T>
T model_torque(const CompensationParams<T>& p, const LoadModel<T>& m, T backlash, T vel) {
  const T half = T(0.5) * backlash;
  const T wound = m.twist_rad - clamp(m.twist_rad, -half, half);
  const T stiffness = stiffness_of(p);
  const T damping = T(2.0 * kMeshDamping) * vsqrt(stiffness * p.inertia_load_kg_m2);
  const T torque = stiffness * wound + damping * (vel - m.vel_rad_s);
  return select(torque * wound > T(0.0), torque, T(0.0));
}

// What a model leaves of the torque.
template <class T>
T model_error(const CompensationParams<T>& p, const LoadInputs<T>& in, T torque) {
  return in.torque_nm - torque - in.direction * p.friction_load_ratio * vabs(torque);
}

// A model stands on the flank that the load torque asks for, or between them where friction holds it.
template <class T>
void begin_model(const CompensationParams<T>& p, const LoadInputs<T>& in, T backlash, MaskOf<T> going,
                 LoadModel<T>& m) {
  const T flank = clamp(in.moment_nm / in.friction_nm, T(-1.0), T(1.0));
  const T twist = in.moment_nm / stiffness_of(p) + T(0.5) * backlash * flank;
  m.twist_rad = select(going, m.twist_rad, twist);
  m.vel_rad_s = select(going, m.vel_rad_s, T(0.0));
  const T error = model_error(p, in, model_torque(p, m, backlash, T(0.0)));
  m.fast_nm = select(going, m.fast_nm, error);
  m.smooth_nm = select(going, m.smooth_nm, error);
  m.slow_nm = select(going, m.slow_nm, error);
}

// One scan of a model; `heard`: the torque is a number; `weight` of its error in the sum of squares, `kept`
// of the sum.
template <class T>
void run_model(const CompensationParams<T>& p, const LoadInputs<T>& in, T backlash, MaskOf<T> heard, T weight,
               T kept, LoadModel<T>& m) {
  const T torque = model_torque(p, m, backlash, in.vel_rad_s);
  const T error = select(heard, model_error(p, in, torque), m.fast_nm);
  m.fast_nm = m.fast_nm + p.backlash_fast * (error - m.fast_nm);
  m.smooth_nm = m.smooth_nm + p.backlash_fast * (m.fast_nm - m.smooth_nm);
  m.slow_nm = m.slow_nm + p.backlash_slow * (m.smooth_nm - m.slow_nm);
  const T swing = m.smooth_nm - m.slow_nm;
  m.misfit = kept * m.misfit + weight * (swing * swing);
  // Dry friction takes speed off, down to 0 and no further.
  const T per_nm = p.period_s / p.inertia_load_kg_m2;
  const T most = per_nm * in.friction_nm;
  const T vel = m.vel_rad_s + per_nm * (torque - in.moment_nm);
  m.vel_rad_s = vel - clamp(vel, -most, most);
  const T back = T(kModelFollows) * p.swing_rad_s * swing / stiffness_of(p);
  m.twist_rad = m.twist_rad + in.step_rad + p.period_s * (back - m.vel_rad_s);
}

// The moment in use, which says on which flank the load lies, is that which is seen.
template <class T>
MaskOf<T> moment_known(const CompensationParams<T>& p, const CompensationState<T>& s) {
  const Moment<T> change = moment_change(p, s);
  const Moment<T> apart{change.sine_nm - s.moment_sine_nm, change.cosine_nm - s.moment_cosine_nm};
  return size_of(apart) < T(kMomentKnown) * p.friction_load_nm;
}

// Friction in use goes on towards what the moment observer finds beside the moment, in the lanes that
// `follow`.
template <class T>
void use_friction(const CompensationParams<T>& p, MaskOf<T> follow, CompensationState<T>& s) {
  const T rate = select(follow, p.observer_rate, T(0.0));
  const T more = clamp(friction_change(p, s), -p.friction_spread_nm, p.friction_spread_nm);
  s.friction_change_nm = s.friction_change_nm + rate * (more - s.friction_change_nm);
}

// Where the sums of squares, with a prior of the calibration as wide as the bank, have their least.
template <class T>
T backlash_seen(const CompensationParams<T>& p, const CompensationState<T>& s) {
  const T widest = T(static_cast<double>(kBacklashModels - 1)) * p.backlash_step_rad;
  std::array<T, kBacklashModels> cost;
  for (int k = 0; k < kBacklashModels; ++k) {
    const T apart = (T(static_cast<double>(k)) * p.backlash_step_rad - p.backlash_held_rad) / widest;
    cost[k] = s.bank[k].misfit + apart * apart;
  }
  T left = cost[0], least = cost[1], right = cost[2], place = T(1.0);
  for (int k = 2; k + 1 < kBacklashModels; ++k) {
    const auto better = cost[k] < least;
    left = select(better, cost[k - 1], left);
    right = select(better, cost[k + 1], right);
    place = select(better, T(static_cast<double>(k)), place);
    least = select(better, cost[k], least);
  }
  const T curvature = left - least - (least - right);
  const T slope = T(0.5) * (left - right);
  const T end = select(slope < T(0.0), T(-1.0), T(1.0));
  const T apart = select(curvature > vabs(slope), slope / curvature, end);
  return (place + apart) * p.backlash_step_rad;
}

// One scan of all models. x: motor angle less gear error, at the gantry. Nothing is learnt or followed at
// rest, where torque or angle are no numbers, while the moment in use, which says on which flank the load
// lies, is not yet that which is seen, nor where the planned torque does not clearly lie on one flank.
// Returns the backlash that is seen.
template <class T>
T observe_backlash(const CompensationParams<T>& p, T ratio, const SetPoint<T>& r, T x, T torque_nm,
                   MaskOf<T> going, CompensationState<T>& s) {
  const auto number = vabs(x) < T(kAnyMotorRad);  // NaN is none
  const T at = select(going, s.motor_last_rad, select(number, x, T(0.0)));
  const T vel_last = select(going, s.motor_vel_rad_s, T(0.0));
  const auto seen = vabs(x - at) < T(kAnyStepRad);
  const T step = select(seen, x - at, vel_last * p.period_s);
  const T vel = step / p.period_s;
  const T z = select(r.vel == T(0.0), T(0.0), sign(r.vel));
  const T inertia_motor = p.inertia_kg_m2 - p.inertia_load_kg_m2;
  const T before = inertia_motor * ((vel - vel_last) / p.period_s) + z * (p.friction_nm - p.friction_load_nm);
  const T torque = ratio * torque_nm - before;
  const auto heard = both(seen, vabs(torque) < T(kAnyTorqueNm));
  const Moment<T> now = moment_now(p, s);
  const LoadInputs<T> in{
      step, vel, select(heard, torque, T(0.0)), holding_moment(now, r.pos).value, friction_load_now(p, s), z};
  const auto moving = both(heard, vabs(z) > T(0.0));
  const T planned = in.moment_nm + z * in.friction_nm + p.inertia_load_kg_m2 * r.acc;
  const auto clear = vabs(planned) > T(kFlankClear) * in.friction_nm;
  const auto ramp = both(vabs(r.acc) > T(0.0), clear);
  const auto tells = both(both(moving, moment_known(p, s)), ramp);
  const T weight = select(tells, p.observer_weight, T(0.0));
  const T kept = select(tells, p.backlash_memory, T(1.0));
  for (int k = 0; k < kBacklashModels; ++k) {
    const T backlash = T(static_cast<double>(k)) * p.backlash_step_rad;
    if (any(negate(going))) begin_model(p, in, backlash, going, s.bank[k]);
    run_model(p, in, backlash, heard, weight, kept, s.bank[k]);
  }
  s.motor_last_rad = select(number, x, at + step);
  s.motor_vel_rad_s = vel;

  const T found = backlash_seen(p, s);
  const T rate = select(moving, p.observer_rate, T(0.0));
  s.backlash_change_rad =
      s.backlash_change_rad + rate * (found - p.backlash_held_rad - s.backlash_change_rad);
  use_friction(p, moving, s);
  return found;
}

}  // namespace gantry::GANTRY_ISA
