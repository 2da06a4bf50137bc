// A complete plant and drive for the tests, every effect present; the values are those of the reference
// machine, rounded. Random variations of it make a family of plants.
#pragma once

#include <random>

#include "core/control/position_law.hpp"
#include "core/control/segments.hpp"
#include "core/plant/gantry_sim.hpp"

namespace gantry::example {

constexpr double kRatio = 1144.0;
constexpr double kCycle = 125e-6;
constexpr double kFineCount = 6.283185307179586 / (2048.0 * 2048.0);

inline PlantParams<double> plant() {
  PlantParams<double> p;
  p.ratio = kRatio;
  p.reducer_ratio = 88.0;
  p.inertia_load = 2.18e6;
  p.inertia_motor = 0.362;
  p.stiffness_1 = 5.12e8;
  p.stiffness_2 = 6.28e8;
  p.stiffness_3 = 7.16e8;
  p.torque_1 = 24050.0;
  p.torque_2 = 86840.0;
  p.damping = 1.67e6;
  p.half_backlash = 1.0566e-5;
  p.hysteresis_torque = 2000.0;
  p.hysteresis_load_ratio = 0.1;
  p.hysteresis_length = 1e-5;
  p.error_reducer_2x = 3.7e-6;
  p.error_reducer_1x = 1.4e-6;
  p.error_reducer_4x = 0.9e-6;
  p.error_pinion = 1.8e-5;
  p.error_mesh = 4e-6;
  p.phase_reducer_2x = 5.1;
  p.phase_reducer_1x = 3.0;
  p.phase_reducer_4x = 2.8;
  p.phase_pinion = 2.2;
  p.phase_mesh = 3.3;
  p.eccentric_moment = -15990.3;
  p.roller_coulomb = 6000.0;
  p.roller_breakaway = 6800.0;
  p.roller_stribeck = 3.5e-4;
  p.roller_viscous = 2e4;
  p.roller_presliding = 3e-5;
  p.roller_micro_damping = 0.3;
  p.motor_coulomb = 5.5;
  p.motor_breakaway = 6.5;
  p.motor_stribeck = 1.0;
  p.motor_viscous = 0.03;
  p.motor_load_ratio = 0.1;
  p.motor_presliding = 0.005;
  p.motor_micro_damping = 0.3;
  p.base_inertia = 6e5;
  p.base_stiffness = 1.16e9;
  p.base_damping = 1.58e6;
  p.ripple_torque = 1.9;
  p.brake_torque = 400.0;
  p.current_bandwidth = 3769.9;
  for (int n = 0; n < kRingHarmonics; ++n) {
    p.error_ring[static_cast<std::size_t>(n)] = 3e-5 / (n + 1.0);
    p.phase_ring[static_cast<std::size_t>(n)] = 0.5 * n;
  }
  p.pinion_teeth = 26;
  p.ripple_order = 12;
  p.gear_error = p.hysteresis = p.backlash = p.roller_friction = p.motor_friction = p.base = p.ripple = true;
  return p;
}

inline DriveParams<double> drive() {
  DriveParams<double> p;
  p.cycle_s = kCycle;
  p.kvp = 77.6959;
  p.tvi_s = 0.01;
  p.torque_rated = 257.0;
  p.torque_max = 385.0;
  p.overload_time_s = 60.0;
  p.vel_max = 130.0;
  p.quick_dec = 110.0;
  p.speed_count = p.position_count = kFineCount;
  p.latency_s = 62.5e-6;
  p.brake_close_s = 0.15;
  p.brake_open_s = 0.1;
  p.delay_cycles = 1;
  return p;
}

template <class T>
GantrySim<T> sim(const PlantParams<T>& plant, const DriveParams<T>& drive,
                 Scheme scheme = Scheme::kOneEvaluation) {
  return {plant, drive, 1e-3, 8, 1200, 800, kCycle, scheme, 2};
}

inline GantrySim<double> sim() { return sim(plant(), drive()); }

// The same plant with every number changed by up to 20 %: what a pack of different plants is made of.
inline PlantParams<double> varied(PlantParams<double> p, std::mt19937& random) {
  std::uniform_real_distribution<double> factor(0.8, 1.2);
#define X(name, value, meaning) p.name *= factor(random);
  GANTRY_PLANT_PARAMS(X)
#undef X
  p.torque_2 = p.torque_1 + 5e4;
  p.friction_ep_ratio = 0.5 * factor(random);
  for (double& a : p.error_ring) a *= factor(random);
  for (double& a : p.phase_ring) a += factor(random);
  return p;
}

inline DriveParams<double> varied(DriveParams<double> p, std::mt19937& random) {
  std::uniform_real_distribution<double> factor(0.8, 1.2);
#define X(name, value, meaning) p.name *= factor(random);
  GANTRY_DRIVE_PARAMS(X)
#undef X
  p.cycle_s = kCycle;
  p.torque_max = 1.5 * p.torque_rated;
  p.speed_filter = 0.1 * factor(random);
  return p;
}

inline PositionLawParams law() { return {10.0, 1.0, kRatio, kFineCount, 125.0}; }

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
