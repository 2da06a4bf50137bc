// Parameters and state of the plant. SI units, everything at the gantry unless the name says motor.
// The lists drive the structs, the bindings and the copy into packs, so a field exists in one place.
#pragma once

#include <array>

#include "core/lane/isa.hpp"

namespace gantry::GANTRY_ISA {

constexpr int kRingHarmonics = 12;
constexpr int kWindWaves = 24;

// clang-format off
// X(name, default, meaning)
#define GANTRY_PLANT_PARAMS(X)                                                                         \
  X(ratio, 1.0, "motor turns per gantry turn, i = i1 i2")                                              \
  X(reducer_ratio, 1.0, "i1, motor turns per pinion turn")                                             \
  X(inertia_load_kg_m2, 1.0, "J")                                                                      \
  X(inertia_motor_kg_m2, 1.0, "Jm: rotor and wave generator, at the motor")                            \
  X(stiffness_1_nm_per_rad, 1.0, "K1")                                                                 \
  X(stiffness_2_nm_per_rad, 1.0, "K2")                                                                 \
  X(stiffness_3_nm_per_rad, 1.0, "K3")                                                                 \
  X(torque_1_nm, 1.0, "T1: K1 below this torque")                                                      \
  X(torque_2_nm, 2.0, "T2: K3 above this torque")                                                      \
  X(damping_nm_s_per_rad, 0.0, "c")                                                                    \
  X(half_backlash_rad, 0.0, "b/2")                                                                     \
  X(hysteresis_torque_nm, 0.0, "T_h0")                                                                 \
  X(hysteresis_load_ratio, 0.0, "mu_h")                                                                \
  X(hysteresis_length_rad, 1e-5, "z_h")                                                                \
  X(error_reducer_2x_rad, 0.0, "gear error, two cycles per motor turn")                                \
  X(error_reducer_1x_rad, 0.0, "gear error, one cycle per motor turn")                                 \
  X(error_reducer_4x_rad, 0.0, "gear error, four cycles per motor turn")                               \
  X(error_pinion_rad, 0.0, "gear error, one cycle per pinion turn")                                    \
  X(error_mesh_rad, 0.0, "gear error, one cycle per tooth")                                            \
  X(phase_reducer_2x_rad, 0.0, "phase of it")                                                          \
  X(phase_reducer_1x_rad, 0.0, "phase of it")                                                          \
  X(phase_reducer_4x_rad, 0.0, "phase of it")                                                          \
  X(phase_pinion_rad, 0.0, "phase of it")                                                              \
  X(phase_mesh_rad, 0.0, "phase of it")                                                                \
  X(eccentric_moment_nm, 0.0, "T_u, signed: the torque on the load is T_u sin(theta - angle)")         \
  X(eccentric_angle_rad, 0.0, "theta_u0")                                                              \
  X(roller_coulomb_nm, 0.0, "Fc of the rollers")                                                       \
  X(roller_breakaway_nm, 0.0, "Fs of the rollers")                                                     \
  X(roller_stribeck_rad_s, 1.0, "vs of the rollers")                                                   \
  X(roller_viscous_nm_s_per_rad, 0.0, "Fv of the rollers")                                             \
  X(roller_presliding_rad, 1e-5, "z_roll")                                                             \
  X(roller_micro_damping, 0.0, "sigma1 = this * sqrt(sigma0 J)")                                       \
  X(motor_coulomb_nm, 0.0, "Fc of motor and reducer input, at the motor")                              \
  X(motor_breakaway_nm, 0.0, "Fs, at the motor")                                                       \
  X(motor_stribeck_rad_s, 1.0, "vs, at the motor")                                                     \
  X(motor_viscous_nm_s_per_rad, 0.0, "Fv, at the motor")                                               \
  X(motor_load_ratio, 0.0, "mu_m: friction per transmitted torque")                                    \
  X(motor_presliding_rad, 1e-3, "z_m, at the motor")                                                   \
  X(motor_micro_damping, 0.0, "sigma1 = this * sqrt(sigma0 Jm)")                                       \
  X(friction_ep_ratio, 0.6, "z_ba/z_ss: elastic below, sliding above")                                 \
  X(base_inertia_kg_m2, 1.0, "Jb")                                                                     \
  X(base_stiffness_nm_per_rad, 1.0, "kb")                                                              \
  X(base_damping_nm_s_per_rad, 0.0, "cb")                                                              \
  X(ripple_torque_nm, 0.0, "torque ripple amplitude, at the motor")                                    \
  X(ripple_full_torque_nm, 20.0, "torque from which the ripple has its full amplitude, at the motor")  \
  X(brake_torque_nm, 0.0, "slip torque of the closed brake, at the motor")                             \
  X(brake_presliding_rad, 5e-4, "z_b, at the motor")                                                   \
  X(current_bandwidth_rad_s, 0.0, "wc of the current loop; 0: ideal, Te = u")                          \
  X(wind_moment_nm, 0.0, "mean moment of the wind on the load")

// X(name, default, meaning): the same for every plant of a pack
#define GANTRY_PLANT_SWITCHES(X)                                                                       \
  X(pinion_teeth, int, 1, "tooth-mesh cycles per pinion turn")                                         \
  X(ripple_order, int, 1, "ripple cycles per motor turn")                                              \
  X(gear_error, bool, false, "gear-error map present")                                                 \
  X(hysteresis, bool, false, "reducer hysteresis present")                                             \
  X(backlash, bool, false, "backlash present: flanks have a gap and cannot pull")                      \
  X(roller_friction, bool, false, "roller friction present")                                           \
  X(motor_friction, bool, false, "motor friction present")                                             \
  X(base, bool, false, "rocking base present")                                                         \
  X(ripple, bool, false, "torque ripple present")                                                      \
  X(wind, bool, false, "moment of the wind present")                                                   \
  X(rigid, bool, false, "one inertia J/i^2 + Jm: theta = theta_m / i")

#define GANTRY_PLANT_STATE(X)                                                                          \
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
  std::array<T, kRingHarmonics> error_ring_rad{};  // gear error, n cycles per gantry turn, rad
  std::array<T, kRingHarmonics> phase_ring_rad{};
  std::array<T, kWindWaves> wind_wave_nm{};  // gusts, N m, rad/s, rad
  std::array<T, kWindWaves> wind_rate_rad_s{};
  std::array<T, kWindWaves> wind_phase_rad{};
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

}  // namespace gantry::GANTRY_ISA
