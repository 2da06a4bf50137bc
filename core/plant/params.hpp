// Parameters and state of the plant. SI units, everything at the gantry unless the name says motor.
// The lists drive the structs, the bindings and the copy into packs, so a field exists in one place.
#pragma once

#include <array>

#include "core/lane/lane.hpp"

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
  X(wind_moment_nm, 0.0, "mean moment of the wind on the load")                                        \
  X(contact_ratio, 2.0, "tooth pairs in mesh on average, 1 < ratio <= 2")                              \
  X(gear_temp_start_k, 0.0, "gears above their temperature of alignment, at the start")                \
  X(gear_temp_end_k, 0.0, "the same in the end")                                                       \
  X(gear_temp_time_s, 1.0, "time constant between them")                                               \
  X(motor_temp_start_k, 0.0, "motor above the temperature of its torque constant, at the start")       \
  X(motor_temp_end_k, 0.0, "the same in the end")                                                      \
  X(motor_temp_time_s, 1.0, "time constant between them")                                              \
  X(half_backlash_rad_per_k, 0.0, "growth of b/2 with the temperature of the gears")                   \
  X(viscosity_per_k, 0.0, "viscous friction goes with exp(this x temperature of the gears)")           \
  X(torque_constant_ratio, 1.0, "torque that the motor gives for the torque that the drive asks of it")   \
  X(torque_constant_per_k, 0.0, "growth of the torque with the temperature of the motor, as a part")   \
  X(roller_ageing_nm, 0.0, "growth of the rollers' breakaway at standstill")                           \
  X(roller_ageing_time_s, 1.0, "time constant of it")                                                  \
  X(roller_ageing_length_rad, 1e-4, "sliding way over which it is lost")                               \
  X(motor_ageing_nm, 0.0, "growth of the motor's breakaway at standstill, at the motor")               \
  X(motor_ageing_time_s, 1.0, "time constant of it")                                                   \
  X(motor_ageing_length_rad, 0.1, "sliding way over which it is lost, at the motor")                   \
  X(cogging_torque_nm, 0.0, "cogging torque amplitude, at the motor")                                  \
  X(cogging_phase_rad, 0.0, "phase of it")                                                             \
  X(cable_moment_nm, 0.0, "moment of the cables on the load at 0 rad")                                 \
  X(cable_moment_1_nm, 0.0, "its growth per rad")                                                      \
  X(cable_moment_2_nm, 0.0, "per rad^2")                                                               \
  X(cable_moment_3_nm, 0.0, "per rad^3")                                                               \
  X(cable_friction_nm, 0.0, "half width of the hysteresis of the cables")                              \
  X(cable_presliding_rad, 1e-2, "angle over which it turns over")                                      \
  X(second_angle_rad, 0.0, "place of the second pinion on the ring, from that of the first")           \
  X(second_phase_reducer_2x_rad, 0.0, "gear error of the second reducer and pinion: phases")           \
  X(second_phase_reducer_1x_rad, 0.0, "phase of it")                                                   \
  X(second_phase_reducer_4x_rad, 0.0, "phase of it")                                                   \
  X(second_phase_pinion_rad, 0.0, "phase of it")                                                       \
  X(second_phase_mesh_rad, 0.0, "phase of it")

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
  X(ring_teeth, int, 0, "teeth of the ring, for the errors of single teeth")                           \
  X(tooth_pitch, bool, false, "pitch errors of single teeth present")                                  \
  X(torque_constant, bool, false, "the drive counts with another torque constant than the motor has")     \
  X(thermal, bool, false, "temperatures act on backlash, viscous friction and torque")                 \
  X(ageing, bool, false, "breakaway grows at standstill")                                              \
  X(cogging_order, int, 1, "cogging cycles per motor turn")                                            \
  X(cogging, bool, false, "cogging torque present")                                                    \
  X(cable, bool, false, "moment of the cables present")                                                \
  X(second_pinion, bool, false, "a second motor, reducer and pinion on the ring")                      \
  X(lost_motor, int, 0, "motor of the two without torque: 0 neither, 1 the first, 2 the second")       \
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

// X(name, switch, meaning): states that exist only with their effect
#define GANTRY_PLANT_EFFECT_STATE(X)                                                                   \
  X(roller_age, ageing, "age of the contact of the rollers, 0 fresh .. 1")                           \
  X(motor_age, ageing, "age of the contacts of the motor, 0 fresh .. 1")                             \
  X(cable_z, cable, "friction state of the cables, rad")                                             \
  X(pos_motor_2, second_pinion, "theta_m of the second motor, rad, relative to the base")            \
  X(vel_motor_2, second_pinion, "omega_m of it, rad/s")                                              \
  X(torque_motor_2, second_pinion, "Te of it, N m")                                                  \
  X(hysteresis_2, second_pinion, "Th of its reducer, N m")                                           \
  X(motor_z_2, second_pinion, "friction state of it, rad")                                           \
  X(motor_age_2, second_pinion, "age of its contacts, 0 fresh .. 1")
// clang-format on

// Deviations of single teeth, at the gantry. A plant has its own; a pack looks into those of its plants,
// which outlive it.
constexpr int kRingTeethMax = 1024;
constexpr int kPinionTeethMax = 128;

enum class Pinion { kFirst, kSecond };

template <class T>
struct ToothPitch {
  const ToothPitch<double>* of_lane[kLanes<T>] = {};
};
template <>
struct ToothPitch<double> {
  std::array<double, kRingTeethMax> ring_rad{};
  std::array<double, kPinionTeethMax> pinion_rad{};
  std::array<double, kPinionTeethMax> second_pinion_rad{};

  const std::array<double, kPinionTeethMax>& of(Pinion pinion) const {
    return pinion == Pinion::kFirst ? pinion_rad : second_pinion_rad;
  }
};

inline const ToothPitch<double>& tooth_pitch_of(const ToothPitch<double>& one, int) { return one; }
inline void set_tooth_pitch(ToothPitch<double>& to, int, const ToothPitch<double>& one) { to = one; }
template <class T>
const ToothPitch<double>& tooth_pitch_of(const ToothPitch<T>& pack, int k) {
  return *pack.of_lane[k];
}
template <class T>
void set_tooth_pitch(ToothPitch<T>& pack, int k, const ToothPitch<double>& one) {
  pack.of_lane[k] = &one;
}

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
  ToothPitch<T> pitch;
#define X(name, type, value, meaning) type name = value;
  GANTRY_PLANT_SWITCHES(X)
#undef X
};

template <class T>
struct PlantState {
#define X(name, ...) T name = T(0.0);
  GANTRY_PLANT_STATE(X)
  GANTRY_PLANT_EFFECT_STATE(X)
#undef X
};

}  // namespace gantry::GANTRY_ISA
