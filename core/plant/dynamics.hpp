// Torques and accelerations of the plant (plant equations S3 to S6).
#pragma once

#include "core/plant/friction.hpp"
#include "core/plant/gear_error.hpp"
#include "core/plant/params.hpp"

namespace gantry::GANTRY_ISA {

// Parameters and what follows from them, computed once.
template <class T>
struct Plant {
  PlantParams<T> p;
  GearError<T> gear;
  FrictionParams<T> roller, motor, brake;
  T break_1, break_2;                                          // wind-up at which the slope changes, rad
  T ratio_inverse;                                             // 1/i
  T motor_inverse, load_inverse, base_inverse, rigid_inverse;  // 1/Jm, 1/J, 1/Jb, 1/(J/i^2 + Jm)
  T ripple_inverse, hysteresis_inverse;

  Plant() : Plant(PlantParams<T>()) {}
  explicit Plant(const PlantParams<T>& params) : p(params), gear(params) {
    roller = {p.roller_coulomb_nm,           p.roller_breakaway_nm,   p.roller_stribeck_rad_s,
              p.roller_viscous_nm_s_per_rad, p.roller_presliding_rad, p.roller_micro_damping,
              p.inertia_load_kg_m2};
    motor = {p.motor_coulomb_nm,           p.motor_breakaway_nm,   p.motor_stribeck_rad_s,
             p.motor_viscous_nm_s_per_rad, p.motor_presliding_rad, p.motor_micro_damping,
             p.inertia_motor_kg_m2};
    // The brake is dry friction of one level: a Stribeck speed so high that its sigma1 does not fall with
    // speed.
    brake = {p.brake_torque_nm,    p.brake_torque_nm, T(1e9), T(0.0), p.brake_presliding_rad, T(1.4),
             p.inertia_motor_kg_m2};
    break_1 = p.torque_1_nm / p.stiffness_1_nm_per_rad;
    break_2 = break_1 + (p.torque_2_nm - p.torque_1_nm) / p.stiffness_2_nm_per_rad;
    ratio_inverse = T(1.0) / p.ratio;
    motor_inverse = T(1.0) / p.inertia_motor_kg_m2;
    load_inverse = T(1.0) / p.inertia_load_kg_m2;
    base_inverse = T(1.0) / p.base_inertia_kg_m2;
    rigid_inverse = T(1.0) / (p.inertia_load_kg_m2 / (p.ratio * p.ratio) + p.inertia_motor_kg_m2);
    ripple_inverse = T(1.0) / p.ripple_full_torque_nm;
    hysteresis_inverse = T(1.0) / p.hysteresis_length_rad;
  }

  // S(x), x >= 0: torque of the three-slope spring.
  GANTRY_INLINE T spring(T x) const {
    const T first = p.stiffness_1_nm_per_rad * x;
    const T second = p.torque_1_nm + p.stiffness_2_nm_per_rad * (x - break_1);
    const T third = p.torque_2_nm + p.stiffness_3_nm_per_rad * (x - break_2);
    return select(x < break_1, first, select(x < break_2, second, third));
  }

  // S^-1(torque), torque >= 0.
  T windup(T torque) const {
    const T second = break_1 + (torque - p.torque_1_nm) / p.stiffness_2_nm_per_rad;
    const T third = break_2 + (torque - p.torque_2_nm) / p.stiffness_3_nm_per_rad;
    return select(torque < p.torque_1_nm, torque / p.stiffness_1_nm_per_rad,
                  select(torque < p.torque_2_nm, second, third));
  }
};

// Everything that acts at one instant.
template <class T>
struct Forces {
  T acc_motor = T(0.0), acc_load = T(0.0), acc_base = T(0.0);
  T torque_mesh = T(0.0);      // Tg, at the gantry
  T hysteresis_rate = T(0.0);  // Th'
  Friction<T> roller, motor, brake;
};

template <class T>
struct Mesh {
  T torque = T(0.0);
  T hysteresis_rate = T(0.0);
};

// Spring, damper, hysteresis and gap between motor and ring (S3); twist = D, twist_rate = D'.
template <class T>
GANTRY_INLINE Mesh<T> mesh_torque(const Plant<T>& plant, T twist, T twist_rate, T hysteresis) {
  const PlantParams<T>& p = plant.p;
  const T side = sign(twist);
  const T windup = vabs(twist) - p.half_backlash_rad;  // |De|, negative in the gap
  const T spring = plant.spring(select(windup > T(0.0), windup, T(0.0)));
  Mesh<T> m;
  m.torque = side * spring + p.damping_nm_s_per_rad * twist_rate + hysteresis;
  if (p.hysteresis) {
    const T h = p.hysteresis_torque_nm + p.hysteresis_load_ratio * spring;
    const T gate = sliding_gate(twist_rate, hysteresis, T(1.0) / h, p.friction_ep_ratio);
    m.hysteresis_rate = plant.hysteresis_inverse * (h * twist_rate - gate * vabs(twist_rate) * hysteresis);
  }
  if (p.backlash) {
    constexpr double kGapDecay = 0.01;  // s
    const auto gap = windup <= T(0.0);
    const auto pulling = m.torque * side < T(0.0);
    m.torque = select(either(gap, pulling), T(0.0), m.torque);
    m.hysteresis_rate = select(gap, hysteresis * T(-1.0 / kGapDecay), m.hysteresis_rate);
  }
  return m;
}

template <class T>
GANTRY_INLINE T ripple_torque(const Plant<T>& plant, T pos_motor, T torque_motor) {
  const T load = vabs(torque_motor) * plant.ripple_inverse;
  const T wave = sincos(pos_motor * T(plant.p.ripple_order)).sin;
  return plant.p.ripple_torque_nm * wave * select(load < T(1.0), load, T(1.0));
}

// Where the gear error of the ring is evaluated once per drive cycle and continued linearly inside it (S9).
template <class T>
struct RingPoint {
  T rho = T(0.0);
  ErrorValue<T> value;
};

template <class T>
GANTRY_INLINE RingPoint<T> ring_point(const Plant<T>& plant, const PlantState<T>& x) {
  RingPoint<T> point;
  if (plant.p.gear_error) {
    point.rho = x.pos_load - x.pos_base;
    point.value = plant.gear.ring_error(point.rho);
  }
  return point;
}

// Friction of the motor, brake and ripple: the torque on the motor shaft besides Te and the mesh.
template <class T>
GANTRY_INLINE T motor_side_torque(const Plant<T>& plant, const PlantState<T>& x, MaskOf<T> brake_closed,
                                  T torque_mesh, Forces<T>& f) {
  const PlantParams<T>& p = plant.p;
  T torque = x.torque_motor;
  if (p.ripple) torque = torque + ripple_torque(plant, x.pos_motor, x.torque_motor);
  if (p.motor_friction) {
    f.motor = friction(plant.motor, x.vel_motor, x.motor_z,
                       p.motor_load_ratio * vabs(torque_mesh) * plant.ratio_inverse, p.friction_ep_ratio);
    torque = torque - f.motor.torque;
  }
  if (any(brake_closed)) {
    f.brake = friction(plant.brake, x.vel_motor, x.brake_z, T(0.0), p.friction_ep_ratio);
    torque = select(brake_closed, torque - f.brake.torque, torque);
  }
  return torque;
}

// Torque of the eccentric moment on the load. The load turns little within a scan, so the sine is taken once
// and rotated from there.
template <class T>
class EccentricTorque {
 public:
  EccentricTorque(const PlantParams<T>& p, T pos_load)
      : moment_(p.eccentric_moment_nm),
        angle_(p.eccentric_angle_rad),
        sine_(pos_load - p.eccentric_angle_rad) {}

  GANTRY_INLINE T operator()(T pos_load) const { return moment_ * sine_(pos_load - angle_); }

 private:
  T moment_;
  T angle_;
  SineNear<T> sine_;
};

template <class T>
GANTRY_INLINE Forces<T> forces(const Plant<T>& plant, const PlantState<T>& x,
                               const EccentricTorque<T>& eccentric, const RingPoint<T>& ring,
                               MaskOf<T> brake_closed) {
  const PlantParams<T>& p = plant.p;
  Forces<T> f;
  const T rho = x.pos_load - x.pos_base;
  const T vel_ring = x.vel_load - x.vel_base;
  T slope_motor = plant.ratio_inverse;
  T slope_ring = T(1.0);
  T twist = x.pos_motor * plant.ratio_inverse - rho;
  if (p.gear_error) {
    const ErrorValue<T> em = plant.gear.motor_error(x.pos_motor, sincos(x.pos_motor));
    twist = twist + em.error + (ring.value.error + ring.value.slope * (rho - ring.rho));
    slope_motor = slope_motor + em.slope;
    slope_ring = slope_ring - ring.value.slope;
  }
  const Mesh<T> mesh =
      mesh_torque(plant, twist, x.vel_motor * slope_motor - vel_ring * slope_ring, x.hysteresis);
  f.torque_mesh = mesh.torque;
  f.hysteresis_rate = mesh.hysteresis_rate;
  const T motor_torque = motor_side_torque(plant, x, brake_closed, mesh.torque, f);
  f.acc_motor = (motor_torque - mesh.torque * slope_motor) * plant.motor_inverse;
  T on_ring = mesh.torque * slope_ring;
  if (p.roller_friction) {
    f.roller = friction(plant.roller, vel_ring, x.roller_z, T(0.0), p.friction_ep_ratio);
    on_ring = on_ring - f.roller.torque;
  }
  f.acc_load = (on_ring + eccentric(x.pos_load)) * plant.load_inverse;
  if (p.base)
    f.acc_base =
        (-on_ring - p.base_stiffness_nm_per_rad * x.pos_base - p.base_damping_nm_s_per_rad * x.vel_base) *
        plant.base_inverse;
  return f;
}

// The rigid switch (S6): one inertia on the motor shaft, theta = theta_m / i; friction of both sides acts on
// it.
template <class T>
GANTRY_INLINE Forces<T> forces_rigid(const Plant<T>& plant, const PlantState<T>& x,
                                     const EccentricTorque<T>& eccentric, MaskOf<T> brake_closed) {
  const PlantParams<T>& p = plant.p;
  Forces<T> f;
  T torque = eccentric(x.pos_load);
  if (p.roller_friction) {
    f.roller = friction(plant.roller, x.vel_load, x.roller_z, T(0.0), p.friction_ep_ratio);
    torque = torque - f.roller.torque;
  }
  const T on_motor = motor_side_torque(plant, x, brake_closed, torque, f) + torque * plant.ratio_inverse;
  f.acc_motor = on_motor * plant.rigid_inverse;
  f.acc_load = f.acc_motor * plant.ratio_inverse;
  f.torque_mesh = p.inertia_load_kg_m2 * f.acc_load - torque;
  return f;
}

}  // namespace gantry::GANTRY_ISA
