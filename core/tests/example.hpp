// A complete plant and drive for the tests, every effect present; the values are those of the reference
// machine, rounded. Random variations of it make a family of plants. Beside it a plant of round numbers.
#pragma once

#include <cmath>
#include <random>

#include "core/control/compensation.hpp"
#include "core/control/position_law.hpp"
#include "core/control/segments.hpp"
#include "core/lane/pack.hpp"
#include "core/plant/gantry_sim.hpp"

namespace gantry::example {

constexpr double kRatio = 1144.0;
constexpr double kCycle = 125e-6;
constexpr double kQuarter = 1.570796326794896619;
constexpr double kTs = 1e-3;          // a scan
constexpr double kMm = 1e-3 / 2.366;  // a millimetre on the ring, rad
constexpr double kFineCount = 6.283185307179586 / (2048.0 * 2048.0);

// Round numbers for figures worked out by hand, no effect present: ratio 10, inertias of 1 and 50 kg m2,
// stiffness 1000, 2000 and 4000 N m/rad with knees at 10 and 30 N m.
inline PlantParams<double> simple_plant() {
  PlantParams<double> p;
  p.ratio = 10.0;
  p.inertia_motor_kg_m2 = 1.0;
  p.inertia_load_kg_m2 = 50.0;
  p.stiffness_1_nm_per_rad = 1000.0;
  p.stiffness_2_nm_per_rad = 2000.0;
  p.stiffness_3_nm_per_rad = 4000.0;
  p.torque_1_nm = 10.0;
  p.torque_2_nm = 30.0;
  return p;
}

inline PlantParams<double> plant() {
  PlantParams<double> p;
  p.ratio = kRatio;
  p.reducer_ratio = 88.0;
  p.inertia_load_kg_m2 = 2.18e6;
  p.inertia_motor_kg_m2 = 0.362;
  p.stiffness_1_nm_per_rad = 5.12e8;
  p.stiffness_2_nm_per_rad = 6.28e8;
  p.stiffness_3_nm_per_rad = 7.16e8;
  p.torque_1_nm = 24050.0;
  p.torque_2_nm = 86840.0;
  p.damping_nm_s_per_rad = 1.67e6;
  p.half_backlash_rad = 1.0566e-5;
  p.hysteresis_torque_nm = 2000.0;
  p.hysteresis_load_ratio = 0.1;
  p.hysteresis_length_rad = 1e-5;
  p.error_reducer_2x_rad = 3.7e-6;
  p.error_reducer_1x_rad = 1.4e-6;
  p.error_reducer_4x_rad = 0.9e-6;
  p.error_pinion_rad = 1.8e-5;
  p.error_mesh_rad = 4e-6;
  p.phase_reducer_2x_rad = 5.1;
  p.phase_reducer_1x_rad = 3.0;
  p.phase_reducer_4x_rad = 2.8;
  p.phase_pinion_rad = 2.2;
  p.phase_mesh_rad = 3.3;
  p.eccentric_moment_nm = -15990.3;
  p.roller_coulomb_nm = 6000.0;
  p.roller_breakaway_nm = 6800.0;
  p.roller_stribeck_rad_s = 3.5e-4;
  p.roller_viscous_nm_s_per_rad = 2e4;
  p.roller_presliding_rad = 3e-5;
  p.roller_micro_damping = 0.3;
  p.motor_coulomb_nm = 5.5;
  p.motor_breakaway_nm = 6.5;
  p.motor_stribeck_rad_s = 1.0;
  p.motor_viscous_nm_s_per_rad = 0.03;
  p.motor_load_ratio = 0.1;
  p.motor_presliding_rad = 0.005;
  p.motor_micro_damping = 0.3;
  p.base_inertia_kg_m2 = 6e5;
  p.base_stiffness_nm_per_rad = 1.16e9;
  p.base_damping_nm_s_per_rad = 1.58e6;
  p.ripple_torque_nm = 1.9;
  p.brake_torque_nm = 400.0;
  p.current_bandwidth_rad_s = 3769.9;
  for (int n = 0; n < kRingHarmonics; ++n) {
    p.error_ring_rad[static_cast<std::size_t>(n)] = 3e-5 / (n + 1.0);
    p.phase_ring_rad[static_cast<std::size_t>(n)] = 0.5 * n;
  }
  p.wind_moment_nm = 2e4;
  for (std::size_t n = 0; n < kWindWaves; ++n) {
    p.wind_wave_nm[n] = 3e3;
    p.wind_rate_rad_s[n] = 0.1 * (static_cast<double>(n) + 1.0);
    p.wind_phase_rad[n] = 0.7 * static_cast<double>(n);
  }
  p.pinion_teeth = 26;
  p.ring_teeth = 338;
  for (std::size_t n = 0; n < 338; ++n) p.pitch.ring_rad[n] = 4e-6 * std::sin(1.7 * double(n * n));
  for (std::size_t n = 0; n < 26; ++n) p.pitch.pinion_rad[n] = 2e-6 * std::sin(2.3 * double(n * n));
  for (std::size_t n = 0; n < 26; ++n) p.pitch.second_pinion_rad[n] = 2e-6 * std::sin(2.9 * double(n * n));
  p.second_angle_rad = 2.5;
  p.second_phase_reducer_2x_rad = 1.1;
  p.second_phase_reducer_1x_rad = 4.0;
  p.second_phase_reducer_4x_rad = 0.3;
  p.second_phase_pinion_rad = 5.2;
  p.second_phase_mesh_rad = 2.4;
  p.contact_ratio = 1.6;
  p.gear_temp_start_k = 2.0;
  p.gear_temp_end_k = -4.0;
  p.gear_temp_time_s = 0.2;
  p.motor_temp_end_k = 60.0;
  p.motor_temp_time_s = 0.3;
  p.half_backlash_rad_per_k = -4e-6;
  p.viscosity_per_k = -0.05;
  p.torque_constant_ratio = 0.97;
  p.torque_constant_per_k = -0.001;
  p.roller_ageing_nm = 3000.0;
  p.roller_ageing_time_s = 0.3;
  p.motor_ageing_nm = 2.0;
  p.motor_ageing_time_s = 0.2;
  p.motor_ageing_length_rad = 0.05;
  p.cogging_torque_nm = 1.5;
  p.cogging_phase_rad = 0.7;
  p.cogging_order = 36;
  p.cable_moment_nm = 300.0;
  p.cable_moment_1_nm = -500.0;
  p.cable_moment_2_nm = 100.0;
  p.cable_moment_3_nm = -50.0;
  p.cable_friction_nm = 400.0;
  p.cable_presliding_rad = 1e-3;
  p.ripple_order = 12;
  p.gear_error = p.hysteresis = p.backlash = p.roller_friction = p.motor_friction = p.base = p.ripple = true;
  return p;
}

inline DriveParams<double> drive() {
  DriveParams<double> p;
  p.cycle_s = kCycle;
  p.kvp_nm_s_per_rad = 77.6959;
  p.tvi_s = 0.01;
  p.torque_rated_nm = 257.0;
  p.torque_max_nm = 385.0;
  p.overload_time_s = 60.0;
  p.vel_max_rad_s = 130.0;
  p.quick_dec_rad_s2 = 110.0;
  p.speed_count_rad = p.position_count_rad = kFineCount;
  p.latency_s = 62.5e-6;
  p.brake_close_s = 0.15;
  p.brake_open_s = 0.1;
  p.delay_cycles = 1;
  p.encoder_lines = 2048.0;
  p.encoder_error_1x_rad = 2e-5;
  p.encoder_error_2x_rad = 1e-5;
  p.encoder_eccentricity_rad = 5e-5;
  p.encoder_eccentricity_phase_rad = 0.4;
  p.preload_nm = 20.0;
  return p;
}

template <class T>
GantrySim<T> sim(const PlantParams<T>& plant, const DriveParams<T>& drive,
                 Scheme scheme = Scheme::kOneEvaluation) {
  return {plant, drive, T(1200.0), T(800.0), {1e-3, kCycle, 8, scheme, 2}};
}

inline GantrySim<double> sim() { return sim(plant(), drive()); }

// Every effect that the reference machine has switched off.
inline PlantParams<double> beyond(PlantParams<double> p) {
  p.wind = p.tooth_pitch = p.torque_constant = p.thermal = p.ageing = p.cogging = p.cable = true;
  return p;
}

// The same with a second motor, reducer and pinion.
inline PlantParams<double> on_two_pinions(PlantParams<double> p, int lost_motor = 0) {
  p.second_pinion = true;
  p.lost_motor = lost_motor;
  return p;
}

// The same plant with every number changed by up to 20 %: what a pack of different plants is made of.
inline PlantParams<double> varied(PlantParams<double> p, std::mt19937& random) {
  std::uniform_real_distribution<double> factor(0.8, 1.2);
#define X(name, value, meaning) p.name *= factor(random);
  GANTRY_PLANT_PARAMS(X)
#undef X
  p.torque_2_nm = p.torque_1_nm + 5e4;
  p.friction_ep_ratio = 0.5 * factor(random);
  for (double& a : p.error_ring_rad) a *= factor(random);
  for (double& a : p.phase_ring_rad) a += factor(random);
  for (double& a : p.wind_wave_nm) a *= factor(random);
  for (double& a : p.wind_rate_rad_s) a *= factor(random);
  for (double& a : p.wind_phase_rad) a += factor(random);
  for (double& a : p.pitch.ring_rad) a *= factor(random);
  for (double& a : p.pitch.pinion_rad) a *= factor(random);
  for (double& a : p.pitch.second_pinion_rad) a *= factor(random);
  return p;
}

inline DriveParams<double> varied(DriveParams<double> p, std::mt19937& random) {
  std::uniform_real_distribution<double> factor(0.8, 1.2);
#define X(name, value, meaning) p.name *= factor(random);
  GANTRY_DRIVE_PARAMS(X)
#undef X
  p.cycle_s = kCycle;
  p.torque_max_nm = 1.5 * p.torque_rated_nm;
  p.speed_filter = 0.1 * factor(random);
  return p;
}

inline PositionLawParams<double> law() { return {10.0, 1.0, kRatio, kFineCount, 125.0}; }

// What the calibration holds of that machine, and its observers of moment and backlash; the bank has steps of
// 0.05 mm on the ring.
inline CompensationParams<double> observed() {
  CompensationParams<double> p;
  p.moment_observer = true;
  p.period_s = kTs;
  p.moment_sine_nm = 1.6e4;
  p.inertia_kg_m2 = 2.64e6;
  p.inertia_load_kg_m2 = 2.17e6;
  p.windup_per_acc_s2 = 6.15e-3;
  p.swing_rad_s = 12.75;
  p.friction_nm = 1.2e4;
  p.friction_load_nm = 6e3;
  p.friction_load_ratio = 0.1;
  p.friction_spread_nm = 6e3;
  p.moment_limit_nm = 3e4;
  p.observer_speed_rad_s = 1e-3;
  p.observer_weight = 4e-3 / (4e3 * 4e3);
  p.observer_memory = std::exp(-kTs / 300.0);
  p.observer_rate = 5e-4;
  p.backlash_step_rad = 0.05 * kMm;
  p.backlash_held_rad = 0.05 * kMm;
  return p;
}

// Gear errors, wind-up, backlash and lost motion, each of them large enough to be seen.
inline CompensationParams<double> maps() {
  CompensationParams<double> p;
  p.gear_map = p.windup = p.reversal = true;
  p.map.mean = 1e-6;
  p.map.sine = {3e-5, -2e-5, 1e-5};
  p.map.cosine = {1e-5, 4e-6, -7e-6};
  p.lost_motion.mean = 1.4e-5;
  p.lost_motion.cosine = {2e-6, -3e-6};
  p.fast[0] = {338.0, 4e-6, 1e-6};
  p.fast[1] = {1144.0, 1e-6, -2e-6};
  p.moment_sine_nm = 1.6e4;
  p.moment_cosine_nm = -2e3;
  p.compliance_rad_per_nm = 2.8e-9;
  p.windup_per_acc_s2 = 6.2e-3;
  p.backlash_rad = 8e-5;
  p.friction_load_nm = 6e3;
  p.inertia_load_kg_m2 = 2.2e6;
  p.flank_nm = 8e4;  // so wide that the derivative below is taken where the flank changes
  p.pos_limit_rad = 1e-3;
  return p;
}

inline Moment<double> calibrated(const CompensationParams<double>& p) {
  return {p.moment_sine_nm, p.moment_cosine_nm};
}

inline Flank<double> flank(const CompensationParams<double>& p) {
  return {p.backlash_rad, p.friction_load_nm, 0.0};
}

// The same in every lane of a pack; maps and fast waves are left as they begin.
template <int N>
CompensationParams<Pack<N>> in_every_lane(const CompensationParams<double>& one) {
  CompensationParams<Pack<N>> many;
#define X(name, meaning) many.name = one.name;
  GANTRY_COMPENSATION_SWITCHES(X)
#undef X
#define X(name, value, meaning) many.name = Pack<N>(one.name);
  GANTRY_COMPENSATION_PARAMS(X)
#undef X
  return many;
}

// From rest to rest over `distance` with constant acceleration and deceleration.
inline Segments triangle(double from, double distance, double acc) {
  const double half = std::sqrt(std::fabs(distance) / acc);
  const double a = distance < 0.0 ? -acc : acc;
  return {{{0.0, from, 0.0, a, 0.0}, {half, from + 0.5 * distance, a * half, -a, 0.0}},
          2.0 * half,
          from + distance,
          0.0};
}

}  // namespace gantry::example
