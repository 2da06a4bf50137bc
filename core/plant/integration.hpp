// Integration over one drive cycle (plant equations S9): one force evaluation, or classical Runge-Kutta.
#pragma once

#include "core/plant/drive.hpp"
#include "core/plant/dynamics.hpp"

namespace gantry::GANTRY_ISA {

enum class Scheme { kOneEvaluation, kRungeKutta4 };

// Current loop: Te' = wc (u - Te), exact for u held over dt; Te = u from the start of the cycle where it is
// ideal.
template <class T>
struct CurrentLoop {
  bool some_ideal;  // in a pack some lanes may be ideal and others not
  bool some_real;
  T decay;  // exp(-wc dt)
  T bandwidth;

  CurrentLoop() = default;
  CurrentLoop(const PlantParams<T>& p, double dt) : bandwidth(p.current_bandwidth_rad_s) {
    const auto real = p.current_bandwidth_rad_s > T(0.0);
    some_ideal = any(negate(real));
    some_real = any(real);
    decay = vexp(-p.current_bandwidth_rad_s * T(dt));
  }

  GANTRY_INLINE T at_start(T u, T torque) const {
    return some_ideal ? select(bandwidth > T(0.0), torque, u) : torque;
  }
  GANTRY_INLINE T at_end(T u, T torque) const {
    return some_real ? u + (torque - u) * decay : torque;  // u itself where it is ideal
  }
};

template <class T>
GANTRY_INLINE Friction<T> roller_ageing(const PlantParams<T>& p, const Forces<T>& f, const PlantState<T>& x) {
  return ageing(f.roller, x.roller_z, x.roller_age, p.roller_ageing_time_s, p.roller_ageing_length_rad);
}
template <class T>
GANTRY_INLINE Friction<T> motor_ageing(const PlantParams<T>& p, const Friction<T>& f, T z, T age) {
  return ageing(f, z, age, p.motor_ageing_time_s, p.motor_ageing_length_rad);
}

// A motor and its reducer over one cycle. The contacts age before the friction states move on: their sliding
// is that of the start of the cycle.
template <class T>
GANTRY_INLINE void step_train(const PlantParams<T>& p, const CurrentLoop<T>& current, const TrainForces<T>& f,
                              T u, T dt, const Train<T>& x) {
  x.torque_motor = current.at_end(u, x.torque_motor);
  if (p.motor_friction) {
    if (p.ageing)
      x.motor_age = friction_step(x.motor_age, motor_ageing(p, f.motor, x.motor_z, x.motor_age), dt);
    x.motor_z = friction_step(x.motor_z, f.motor, dt);
  }
  if (p.hysteresis) {
    // A twist of more than its length in one cycle (9 deg/s between motor and load of a table of 50 kg m2, of
    // which no sound motion has a tenth) would throw it beyond its level, ever further: it slides with that.
    const T most = larger(vabs(x.hysteresis), f.hysteresis_level);
    x.hysteresis = clamp(x.hysteresis + f.hysteresis_rate * dt, -most, most);
  }
  x.vel_motor = x.vel_motor + dt * f.acc_motor;
  x.pos_motor = x.pos_motor + dt * x.vel_motor;
}

// All forces at the start of the cycle; then the exact step of current and friction states, semi-implicit
// Euler of speeds and positions. One evaluation instead of eight; S9 gives its error, the tests hold it to
// that. kTwo: with a second pinion.
template <bool kTwo, class T>
GANTRY_INLINE void step_one_evaluation(const Plant<T>& plant, const CurrentLoop<T>& current,
                                       Anchor<T>& anchor, const MotorTorques<T>& u, MaskOf<T> brake_closed,
                                       T dt, PlantState<T>& x, T& torque_mesh) {
  const PlantParams<T>& p = plant.p;
  x.torque_motor = current.at_start(u.first, x.torque_motor);
  if constexpr (kTwo) x.torque_motor_2 = current.at_start(u.second, x.torque_motor_2);
  const Forces<T> f =
      p.rigid ? forces_rigid(plant, x, anchor, brake_closed) : forces<kTwo>(plant, x, anchor, brake_closed);
  torque_mesh = f.torque_mesh;
  step_train(p, current, f.first, u.first, dt, first_train(x));
  if constexpr (kTwo) step_train(p, current, f.second, u.second, dt, second_train(x));
  if (p.roller_friction) {
    if (p.ageing) x.roller_age = friction_step(x.roller_age, roller_ageing(p, f, x), dt);
    x.roller_z = friction_step(x.roller_z, f.roller, dt);
  }
  if (any(brake_closed))
    x.brake_z = select(brake_closed, friction_step(x.brake_z, f.first.brake, dt), x.brake_z);
  if (p.cable) x.cable_z = friction_step(x.cable_z, f.cable, dt);
  if (p.rigid) {
    x.vel_load = x.vel_motor * plant.ratio_inverse;
    x.pos_load = x.pos_motor * plant.ratio_inverse;
    return;
  }
  x.vel_load = x.vel_load + dt * f.acc_load;
  x.pos_load = x.pos_load + dt * x.vel_load;
  if (p.base) {
    x.vel_base = x.vel_base + dt * f.acc_base;
    x.pos_base = x.pos_base + dt * x.vel_base;
  }
}

template <class T>
GANTRY_INLINE void train_derivative(const PlantParams<T>& p, const CurrentLoop<T>& current,
                                    const TrainForces<T>& f, T u, const Train<const T>& x,
                                    const Train<T>& d) {
  d.pos_motor = x.vel_motor;
  d.vel_motor = f.acc_motor;
  if (current.some_real) d.torque_motor = current.bandwidth * (u - x.torque_motor);
  if (p.hysteresis) d.hysteresis = f.hysteresis_rate;
  if (p.motor_friction) d.motor_z = f.motor.z_rate;
  if (p.ageing && p.motor_friction) d.motor_age = motor_ageing(p, f.motor, x.motor_z, x.motor_age).z_rate;
}

// x' = f(x): all states but that of the brake.
template <bool kTwo, class T>
PlantState<T> derivative(const Plant<T>& plant, const CurrentLoop<T>& current, Anchor<T>& anchor,
                         const MotorTorques<T>& u, MaskOf<T> brake_closed, const PlantState<T>& x,
                         T& torque_mesh) {
  const PlantParams<T>& p = plant.p;
  const Forces<T> f =
      p.rigid ? forces_rigid(plant, x, anchor, brake_closed) : forces<kTwo>(plant, x, anchor, brake_closed);
  torque_mesh = f.torque_mesh;
  PlantState<T> d;
  train_derivative(p, current, f.first, u.first, first_train(x), first_train(d));
  if constexpr (kTwo) train_derivative(p, current, f.second, u.second, second_train(x), second_train(d));
  d.pos_load = p.rigid ? x.vel_motor * plant.ratio_inverse : x.vel_load;
  d.vel_load = f.acc_load;
  d.pos_base = x.vel_base;
  d.vel_base = f.acc_base;
  if (p.roller_friction) d.roller_z = f.roller.z_rate;
  if (p.ageing && p.roller_friction) d.roller_age = roller_ageing(p, f, x).z_rate;
  if (p.cable) d.cable_z = f.cable.z_rate;
  return d;
}

// States of effects that are off stay.
template <class T>
PlantState<T> advanced(const PlantParams<T>& p, const PlantState<T>& x, const PlantState<T>& d, T dt) {
  PlantState<T> y = x;
#define X(name, ...) y.name = x.name + dt * d.name;
  GANTRY_PLANT_STATE(X)
#undef X
#define X(name, effect, meaning) \
  if (p.effect) y.name = x.name + dt * d.name;
  GANTRY_PLANT_EFFECT_STATE(X)
#undef X
  return y;
}

// Classical fourth order, `steps` sub-steps per cycle. A brake that slips at full speed turns its state over
// in 4 us, far beyond what an explicit method survives: that one state takes the exact step for held speed,
// after the others. kTwo: with a second pinion.
template <bool kTwo, class T>
void step_runge_kutta(const Plant<T>& plant, const CurrentLoop<T>& current, Anchor<T>& anchor,
                      const MotorTorques<T>& u, MaskOf<T> brake_closed, T dt, int steps, PlantState<T>& x,
                      T& torque_mesh) {
  x.torque_motor = current.at_start(u.first, x.torque_motor);
  if constexpr (kTwo) x.torque_motor_2 = current.at_start(u.second, x.torque_motor_2);
  const T h = dt / T(steps);
  const auto slope = [&](const PlantState<T>& at) {
    return derivative<kTwo>(plant, current, anchor, u, brake_closed, at, torque_mesh);
  };
  for (int k = 0; k < steps; ++k) {
    const PlantState<T> k1 = slope(x);
    const PlantState<T> k2 = slope(advanced(plant.p, x, k1, T(0.5) * h));
    const PlantState<T> k3 = slope(advanced(plant.p, x, k2, T(0.5) * h));
    const PlantState<T> k4 = slope(advanced(plant.p, x, k3, h));
    const T sixth = h / T(6.0);
#define X(name, ...) x.name = x.name + sixth * (k1.name + T(2.0) * k2.name + T(2.0) * k3.name + k4.name);
    GANTRY_PLANT_STATE(X)
#undef X
#define X(name, effect, meaning) \
  if (plant.p.effect) x.name = x.name + sixth * (k1.name + T(2.0) * k2.name + T(2.0) * k3.name + k4.name);
    GANTRY_PLANT_EFFECT_STATE(X)
#undef X
    if (any(brake_closed)) {
      const Friction<T> brake = friction<false>(plant.brake, plant.gate, x.vel_motor, x.brake_z);
      x.brake_z = select(brake_closed, friction_step(x.brake_z, brake, h), x.brake_z);
    }
  }
}

}  // namespace gantry::GANTRY_ISA
