// Torques and accelerations of the plant (plant equations S3 to S6).
#pragma once

#include "core/plant/anchor.hpp"
#include "core/plant/friction.hpp"

namespace gantry::GANTRY_ISA {

// Parameters and what follows from them, computed once.
template <class T>
struct Plant {
  PlantParams<T> p;
  GearError<T> gear;
  GearError<T> second_gear;  // of the second motor's side; without one it is not looked at
  FrictionParams<T> roller, motor, brake, cable;
  Gate<T> gate;
  Harmonic<T> cogging;                                         // over cogging_order x motor angle
  T break_1, break_2;                                          // wind-up at which the slope changes, rad
  T ratio_inverse;                                             // 1/i
  T motor_inverse, load_inverse, base_inverse, rigid_inverse;  // 1/Jm, 1/J, 1/Jb, 1/(J/i^2 + Jm)
  T ripple_inverse, hysteresis_inverse;

  Plant() : Plant(PlantParams<T>()) {}
  explicit Plant(const PlantParams<T>& params)
      : p(params), gear(params), second_gear(GearError<T>::of_second(params)) {
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
    // Cables: one level, no damping of their own before they slide.
    cable = {p.cable_friction_nm, p.cable_friction_nm, T(1e-9), T(0.0), p.cable_presliding_rad, T(0.0),
             p.inertia_load_kg_m2};
    cogging = Harmonic<T>(p.cogging_torque_nm, p.cogging_phase_rad);
    gate = gate_of(p.friction_ep_ratio);
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

// A motor with its reducer and pinion: where it is, and how its states are called.
template <class T>
struct Train {
  T& pos_motor;
  T& vel_motor;
  T& torque_motor;
  T& hysteresis;
  T& motor_z;
  T& motor_age;
};

template <class T>
GANTRY_INLINE Train<T> first_train(PlantState<T>& x) {
  return {x.pos_motor, x.vel_motor, x.torque_motor, x.hysteresis, x.motor_z, x.motor_age};
}
template <class T>
GANTRY_INLINE Train<const T> first_train(const PlantState<T>& x) {
  return {x.pos_motor, x.vel_motor, x.torque_motor, x.hysteresis, x.motor_z, x.motor_age};
}
template <class T>
GANTRY_INLINE Train<T> second_train(PlantState<T>& x) {
  return {x.pos_motor_2, x.vel_motor_2, x.torque_motor_2, x.hysteresis_2, x.motor_z_2, x.motor_age_2};
}
template <class T>
GANTRY_INLINE Train<const T> second_train(const PlantState<T>& x) {
  return {x.pos_motor_2, x.vel_motor_2, x.torque_motor_2, x.hysteresis_2, x.motor_z_2, x.motor_age_2};
}

// What acts in it.
template <class T>
struct TrainForces {
  T acc_motor = T(0.0);
  T torque_mesh = T(0.0);       // Tg, at the gantry
  T on_ring = T(0.0);           // Tg (1 - e_r')
  T hysteresis_rate = T(0.0);   // Th'
  T hysteresis_level = T(0.0);  // most that |Th| slides with
  Friction<T> motor, brake;
};

// Everything that acts at one instant.
template <class T>
struct Forces {
  TrainForces<T> first;
  TrainForces<T> second;  // of the second pinion
  T acc_load;
  T acc_base = T(0.0);
  T torque_mesh;  // Tg of the pinion that carries more
  Friction<T> roller, cable;
};

template <class T>
struct Mesh {
  T torque;
  T hysteresis_rate = T(0.0);
  T hysteresis_level = T(0.0);
};

// Spring, damper, hysteresis and gap between motor and ring (S3); twist = D, twist_rate = D', half_gap = b/2.
template <class T>
GANTRY_INLINE Mesh<T> mesh_torque(const Plant<T>& plant, T half_gap, T twist, T twist_rate, T hysteresis) {
  const PlantParams<T>& p = plant.p;
  const T side = sign(twist);
  const T windup = vabs(twist) - half_gap;  // |De|, negative in the gap
  const T spring = plant.spring(larger(windup, T(0.0)));
  Mesh<T> m;
  m.torque = side * spring + p.damping_nm_s_per_rad * twist_rate + hysteresis;
  if (p.hysteresis) {
    const T h = p.hysteresis_torque_nm + p.hysteresis_load_ratio * spring;
    const T gate = plant.gate(twist_rate, hysteresis, T(1.0) / h);
    m.hysteresis_rate = plant.hysteresis_inverse * (h * twist_rate - gate * vabs(twist_rate) * hysteresis);
    m.hysteresis_level = h;
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

// Torque ripple; `wave` is the sine of its multiple of the motor angle.
template <class T>
GANTRY_INLINE T ripple_torque(const Plant<T>& plant, T wave, T torque_motor) {
  const T load = vabs(torque_motor) * plant.ripple_inverse;
  return plant.p.ripple_torque_nm * wave * smaller(load, T(1.0));
}

// Viscous friction at another temperature than that of alignment.
template <class T>
GANTRY_INLINE void thicken(const FrictionParams<T>& p, const Thermal<T>& thermal, T vel, Friction<T>& f) {
  f.torque = f.torque + (thermal.viscosity - T(1.0)) * (p.viscous * vel);
}

// What the motor angle contributes: gear error of reducer and pinion, sine of the ripple, cogging torque.
template <class T>
struct MotorSide {
  ErrorValue<T> error;
  T ripple = T(0.0);
  T cogging = T(0.0);
};

// Friction of the motor, brake, ripple and cogging: the torque on the motor shaft besides the mesh.
template <class T>
GANTRY_INLINE T motor_side_torque(const Plant<T>& plant, const Train<const T>& x, const Thermal<T>& thermal,
                                  MaskOf<T> brake_closed, T brake_z, T torque_mesh, const MotorSide<T>& side,
                                  TrainForces<T>& f) {
  const PlantParams<T>& p = plant.p;
  T torque = x.torque_motor;
  if (p.thermal || p.torque_constant) torque = torque * thermal.motor_torque;
  if (p.ripple) torque = torque + ripple_torque(plant, side.ripple, x.torque_motor);
  if (p.cogging) torque = torque + side.cogging;
  if (p.motor_friction) {
    T load_torque = p.motor_load_ratio * vabs(torque_mesh) * plant.ratio_inverse;
    if (p.ageing) load_torque = load_torque + p.motor_ageing_nm * x.motor_age;
    f.motor = friction<true>(plant.motor, plant.gate, x.vel_motor, x.motor_z, load_torque);
    if (p.thermal) thicken(plant.motor, thermal, x.vel_motor, f.motor);
    torque = torque - f.motor.torque;
  }
  if (any(brake_closed)) {
    f.brake = friction<false>(plant.brake, plant.gate, x.vel_motor, brake_z);
    torque = select(brake_closed, torque - f.brake.torque, torque);
  }
  return torque;
}

template <class T>
GANTRY_INLINE MotorSide<T> motor_side(const Plant<T>& plant, const GearError<T>& gear, MotorWaves<T>& waves,
                                      T pos_motor) {
  const PlantParams<T>& p = plant.p;
  MotorSide<T> side;
  if (!p.gear_error && !p.ripple && !p.cogging) return side;
  waves.reach(gear, pos_motor);
  const T way = pos_motor - waves.pos;
  const SinCos<T> motor = angle_sum(waves.motor, sincos_small<4>(way));
  if (p.gear_error) {
    const SinCos<T> two = twice(motor);
    const T turn = way * gear.pinion_per_motor;
    side.error = gear.motor_error(motor, two, twice(two), waves.turn.rotated(sincos_small<2>(turn)),
                                  waves.tooth.rotated(sincos_small<3>(turn * gear.teeth)));
  }
  if (p.ripple) side.ripple = multiple(motor, p.ripple_order).sin;
  if (p.cogging) side.cogging = plant.cogging.value(multiple(motor, p.cogging_order));
  return side;
}

// Friction of the rollers, older contacts holding more.
template <class T>
GANTRY_INLINE Friction<T> roller_friction(const Plant<T>& plant, const Thermal<T>& thermal, T vel,
                                          const PlantState<T>& x) {
  const PlantParams<T>& p = plant.p;
  Friction<T> f =
      p.ageing ? friction<true>(plant.roller, plant.gate, vel, x.roller_z, p.roller_ageing_nm * x.roller_age)
               : friction<false>(plant.roller, plant.gate, vel, x.roller_z);
  if (p.thermal) thicken(plant.roller, thermal, vel, f);
  return f;
}

// Moment of the cables on the load: a polynomial of the ring's angle, and their hysteresis.
template <class T>
GANTRY_INLINE T cable_moment(const PlantParams<T>& p, T rho) {
  return p.cable_moment_nm +
         rho * (p.cable_moment_1_nm + rho * (p.cable_moment_2_nm + rho * p.cable_moment_3_nm));
}

template <class T>
GANTRY_INLINE T cable_torque(const Plant<T>& plant, T rho, T vel, T z, Forces<T>& f) {
  f.cable = friction<false>(plant.cable, plant.gate, vel, z);
  return cable_moment(plant.p, rho) - f.cable.torque;
}

// From a motor to the ring, which has turned by rho and meets the pinion at ring_angle.
template <class T>
GANTRY_INLINE TrainForces<T> train_forces(const Plant<T>& plant, const GearError<T>& gear,
                                          const Train<const T>& x, TrainAnchor<T>& anchor,
                                          const Thermal<T>& thermal, MaskOf<T> brake_closed, T brake_z, T rho,
                                          T ring_angle, T vel_ring) {
  const PlantParams<T>& p = plant.p;
  TrainForces<T> f;
  T slope_motor = plant.ratio_inverse;
  T slope_ring = T(1.0);
  T twist = x.pos_motor * plant.ratio_inverse - rho;
  const MotorSide<T> motor = motor_side(plant, gear, anchor.waves, x.pos_motor);
  if (p.gear_error || p.tooth_pitch) {
    const ErrorValue<T> ring = anchor.ring.at(ring_angle);
    twist = twist + motor.error.error + ring.error;
    slope_motor = slope_motor + motor.error.slope;
    slope_ring = slope_ring - ring.slope;
  }
  if (p.tooth_pitch) {
    const ErrorValue<T> pinion = anchor.pinion_pitch.at(x.pos_motor);
    twist = twist + pinion.error;
    slope_motor = slope_motor + pinion.slope;
  }
  const Mesh<T> mesh = mesh_torque(plant, thermal.half_backlash, twist,
                                   x.vel_motor * slope_motor - vel_ring * slope_ring, x.hysteresis);
  f.torque_mesh = mesh.torque;
  f.hysteresis_rate = mesh.hysteresis_rate;
  f.hysteresis_level = mesh.hysteresis_level;
  const T motor_torque = motor_side_torque(plant, x, thermal, brake_closed, brake_z, mesh.torque, motor, f);
  f.acc_motor = (motor_torque - mesh.torque * slope_motor) * plant.motor_inverse;
  f.on_ring = mesh.torque * slope_ring;
  return f;
}

// kTwo: with a second pinion, whose motor has no brake. A plant with one pays nothing for it.
template <bool kTwo = false, class T>
GANTRY_INLINE Forces<T> forces(const Plant<T>& plant, const PlantState<T>& x, Anchor<T>& anchor,
                               MaskOf<T> brake_closed) {
  const PlantParams<T>& p = plant.p;
  Forces<T> f;
  const T rho = x.pos_load - x.pos_base;
  const T vel_ring = x.vel_load - x.vel_base;
  f.first = train_forces(plant, plant.gear, first_train(x), anchor.first, anchor.thermal, brake_closed,
                         x.brake_z, rho, rho, vel_ring);
  f.torque_mesh = f.first.torque_mesh;
  T on_ring = f.first.on_ring;
  if constexpr (kTwo) {
    f.second = train_forces(plant, plant.second_gear, second_train(x), anchor.second, anchor.thermal,
                            mask<T>(false), T{}, rho, rho + p.second_angle_rad, vel_ring);
    const T other = f.second.torque_mesh;
    f.torque_mesh = select(vabs(other) > vabs(f.torque_mesh), other, f.torque_mesh);
    on_ring = on_ring + f.second.on_ring;
  }
  if (p.roller_friction) {
    f.roller = roller_friction(plant, anchor.thermal, vel_ring, x);
    on_ring = on_ring - f.roller.torque;
  }
  if (p.cable) on_ring = on_ring + cable_torque(plant, rho, vel_ring, x.cable_z, f);
  T on_load = on_ring + anchor.eccentric(x.pos_load);
  if (p.wind) on_load = on_load + anchor.wind;
  f.acc_load = on_load * plant.load_inverse;
  if (p.base)
    f.acc_base =
        (-on_ring - p.base_stiffness_nm_per_rad * x.pos_base - p.base_damping_nm_s_per_rad * x.vel_base) *
        plant.base_inverse;
  return f;
}

// The rigid switch (S6): one inertia on the motor shaft, theta = theta_m / i; friction of both sides acts on
// it.
template <class T>
GANTRY_INLINE Forces<T> forces_rigid(const Plant<T>& plant, const PlantState<T>& x, Anchor<T>& anchor,
                                     MaskOf<T> brake_closed) {
  const PlantParams<T>& p = plant.p;
  Forces<T> f;
  T torque = anchor.eccentric(x.pos_load);
  if (p.wind) torque = torque + anchor.wind;
  if (p.roller_friction) {
    f.roller = roller_friction(plant, anchor.thermal, x.vel_load, x);
    torque = torque - f.roller.torque;
  }
  if (p.cable) torque = torque + cable_torque(plant, x.pos_load, x.vel_load, x.cable_z, f);
  const T on_motor =
      motor_side_torque(plant, first_train(x), anchor.thermal, brake_closed, x.brake_z, torque,
                        motor_side(plant, plant.gear, anchor.first.waves, x.pos_motor), f.first) +
      torque * plant.ratio_inverse;
  f.first.acc_motor = on_motor * plant.rigid_inverse;
  f.acc_load = f.first.acc_motor * plant.ratio_inverse;
  f.torque_mesh = p.inertia_load_kg_m2 * f.acc_load - torque;
  return f;
}

}  // namespace gantry::GANTRY_ISA
