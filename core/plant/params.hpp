// Parameters and state of the plant. SI units, everything at the gantry unless the name says motor.
// The lists drive the structs, the bindings and the copy into packs, so a field exists in one place.
#pragma once

#include <array>

namespace gantry {

constexpr int kRingHarmonics = 12;

// clang-format off
// X(name, default, meaning)
#define GANTRY_PLANT_PARAMS(X)                                                                       \
  X(ratio, 1.0, "motor turns per gantry turn, i = i1 i2")                                            \
  X(reducer_ratio, 1.0, "i1, motor turns per pinion turn")                                           \
  X(inertia_load, 1.0, "J, kg m2")                                                                   \
  X(inertia_motor, 1.0, "Jm: rotor and wave generator, kg m2 at the motor")                          \
  X(stiffness_1, 1.0, "K1, N m/rad")                                                                 \
  X(stiffness_2, 1.0, "K2, N m/rad")                                                                 \
  X(stiffness_3, 1.0, "K3, N m/rad")                                                                 \
  X(torque_1, 1.0, "T1: K1 below this torque, N m")                                                  \
  X(torque_2, 2.0, "T2: K3 above this torque, N m")                                                  \
  X(damping, 0.0, "c, N m s/rad")                                                                    \
  X(half_backlash, 0.0, "b/2, rad")                                                                  \
  X(hysteresis_torque, 0.0, "T_h0, N m")                                                             \
  X(hysteresis_load_ratio, 0.0, "mu_h")                                                              \
  X(hysteresis_length, 1e-5, "z_h, rad")                                                             \
  X(error_reducer_2x, 0.0, "gear error, two cycles per motor turn, rad")                             \
  X(error_reducer_1x, 0.0, "gear error, one cycle per motor turn, rad")                              \
  X(error_reducer_4x, 0.0, "gear error, four cycles per motor turn, rad")                            \
  X(error_pinion, 0.0, "gear error, one cycle per pinion turn, rad")                                 \
  X(error_mesh, 0.0, "gear error, one cycle per tooth, rad")                                         \
  X(phase_reducer_2x, 0.0, "rad")                                                                    \
  X(phase_reducer_1x, 0.0, "rad")                                                                    \
  X(phase_reducer_4x, 0.0, "rad")                                                                    \
  X(phase_pinion, 0.0, "rad")                                                                        \
  X(phase_mesh, 0.0, "rad")                                                                          \
  X(eccentric_moment, 0.0, "T_u, signed: the torque on the load is T_u sin(theta - angle), N m")     \
  X(eccentric_angle, 0.0, "theta_u0, rad")                                                           \
  X(roller_coulomb, 0.0, "Fc of the rollers, N m")                                                   \
  X(roller_breakaway, 0.0, "Fs of the rollers, N m")                                                 \
  X(roller_stribeck, 1.0, "vs of the rollers, rad/s")                                                \
  X(roller_viscous, 0.0, "Fv of the rollers, N m s/rad")                                             \
  X(roller_presliding, 1e-5, "z_roll, rad")                                                          \
  X(roller_micro_damping, 0.0, "sigma1 = this * sqrt(sigma0 J)")                                     \
  X(motor_coulomb, 0.0, "Fc of motor and reducer input, N m at the motor")                           \
  X(motor_breakaway, 0.0, "Fs, N m at the motor")                                                    \
  X(motor_stribeck, 1.0, "vs, rad/s at the motor")                                                   \
  X(motor_viscous, 0.0, "Fv, N m s/rad at the motor")                                                \
  X(motor_load_ratio, 0.0, "mu_m: friction per transmitted torque")                                  \
  X(motor_presliding, 1e-3, "z_m, rad at the motor")                                                 \
  X(motor_micro_damping, 0.0, "sigma1 = this * sqrt(sigma0 Jm)")                                     \
  X(friction_ep_ratio, 0.6, "z_ba/z_ss: elastic below, sliding above")                               \
  X(base_inertia, 1.0, "Jb, kg m2")                                                                  \
  X(base_stiffness, 1.0, "kb, N m/rad")                                                              \
  X(base_damping, 0.0, "cb, N m s/rad")                                                              \
  X(ripple_torque, 0.0, "torque ripple amplitude, N m at the motor")                                 \
  X(ripple_full_torque, 20.0, "torque from which the ripple has its full amplitude, N m at the motor") \
  X(brake_torque, 0.0, "slip torque of the closed brake, N m at the motor")                          \
  X(brake_presliding, 5e-4, "z_b, rad at the motor")                                                 \
  X(current_bandwidth, 0.0, "wc of the current loop, rad/s; 0: ideal, Te = u")

// X(name, default, meaning): the same for every plant of a pack
#define GANTRY_PLANT_SWITCHES(X)                                                                     \
  X(pinion_teeth, int, 1, "tooth-mesh cycles per pinion turn")                                       \
  X(ripple_order, int, 1, "ripple cycles per motor turn")                                            \
  X(gear_error, bool, false, "gear-error map present")                                               \
  X(hysteresis, bool, false, "reducer hysteresis present")                                           \
  X(backlash, bool, false, "backlash present: flanks have a gap and cannot pull")                    \
  X(roller_friction, bool, false, "roller friction present")                                         \
  X(motor_friction, bool, false, "motor friction present")                                           \
  X(base, bool, false, "rocking base present")                                                       \
  X(ripple, bool, false, "torque ripple present")                                                    \
  X(rigid, bool, false, "one inertia J/i^2 + Jm: theta = theta_m / i")

#define GANTRY_PLANT_STATE(X)                                                                        \
  X(pos_motor, "theta_m, rad, relative to the base")                                                 \
  X(vel_motor, "omega_m, rad/s")                                                                     \
  X(pos_load, "theta, rad, inertial")                                                                \
  X(vel_load, "omega, rad/s, inertial")                                                              \
  X(pos_base, "phi, rad")                                                                            \
  X(vel_base, "phi', rad/s")                                                                         \
  X(torque_motor, "Te, N m")                                                                         \
  X(hysteresis, "Th, N m")                                                                           \
  X(roller_z, "friction state of the rollers, rad")                                                  \
  X(motor_z, "friction state of the motor, rad")                                                     \
  X(brake_z, "friction state of the brake, rad")
// clang-format on

template <class T>
struct PlantParams {
#define X(name, value, meaning) T name = T(value);
  GANTRY_PLANT_PARAMS(X)
#undef X
  std::array<T, kRingHarmonics> error_ring{};  // gear error, n cycles per gantry turn, rad
  std::array<T, kRingHarmonics> phase_ring{};
#define X(name, type, value, meaning) type name = value;
  GANTRY_PLANT_SWITCHES(X)
#undef X
};

template <class T>
struct PlantState {
#define X(name, meaning) T name = T(0.0);
  GANTRY_PLANT_STATE(X)
#undef X
};

}  // namespace gantry
