// Plants in motion against closed forms, by both ways to integrate them: the exact step of one evaluation is
// of the first order in the drive cycle, Runge-Kutta of the fourth.
#include "core/plant/integration.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "example.hpp"

namespace gantry {
namespace {

using example::simple_plant;

constexpr double kCycle = 125e-6;
constexpr Scheme kSchemes[] = {Scheme::kOneEvaluation, Scheme::kRungeKutta4};

// At rest at 0 with the brake open and no drive; inertias so large that a speed is kept where asked for.
GantrySim<double> at_rest(const PlantParams<double>& p, Scheme scheme) {
  GantrySim<double> sim(p, {}, 0.0, 0.0, {1e-3, kCycle, 8, scheme, 2});
  sim.brake.closed = false;
  return sim;
}

PlantParams<double> heavy() {
  PlantParams<double> p = simple_plant();
  p.inertia_load_kg_m2 = p.inertia_motor_kg_m2 = p.base_inertia_kg_m2 = 1e15;
  return p;
}

void pass(GantrySim<double>& sim, double seconds, double torque = 0.0) {
  const int cycles = static_cast<int>(std::lround(seconds / kCycle));
  for (int k = 0; k < cycles; ++k) sim.advance(torque, kCycle);
}

bool exact(Scheme scheme) { return scheme == Scheme::kRungeKutta4; }

// 3 N m on 50 / 10^2 + 1 = 1.5 kg m2: 2 rad/s and 1 rad after a second. Positions of the first order are half
// a cycle ahead.
TEST(Integration, a_constant_torque_gives_a_parabola) {
  PlantParams<double> p = simple_plant();
  p.rigid = true;
  for (Scheme scheme : kSchemes)
    for (double side : {1.0, -1.0}) {
      GantrySim<double> sim = at_rest(p, scheme);
      pass(sim, 1.0, side * 3.0);
      EXPECT_NEAR(sim.x.vel_motor, side * 2.0, 1e-10);
      EXPECT_NEAR(sim.x.pos_motor, side * (exact(scheme) ? 1.0 : 1.0 + kCycle), 1e-9);
      EXPECT_NEAR(sim.x.vel_load, side * 0.2, 1e-10);
      EXPECT_NEAR(sim.x.pos_load, 0.1 * sim.x.pos_motor, 1e-9);
      EXPECT_EQ(sim.x.torque_motor, side * 3.0);
      EXPECT_NEAR(sim.report.torque_mesh, side * 50.0 * 0.2, 1e-9);
    }
}

// 1000 N m/rad between 50 kg m2 and 10^2 x 1 kg m2: w^2 = 1000 / 50 + 1000 / 100 = 30; 20 N m s/rad damp with
// 0.3 /s. What the load has of angular momentum the motor has lost, ten times its own.
TEST(Integration, a_wound_gear_swings_and_keeps_the_momentum) {
  PlantParams<double> p = simple_plant();
  p.damping_nm_s_per_rad = 20.0;
  const double damping = 0.3, rate = std::sqrt(30.0 - damping * damping);
  for (Scheme scheme : kSchemes) {
    GantrySim<double> sim = at_rest(p, scheme);
    sim.x.pos_motor = 0.05;  // 5 mrad at the gantry
    for (int k = 1; k <= 10; ++k) {
      pass(sim, 0.1);
      const double t = 0.1 * k;
      const double twist =
          0.005 * std::exp(-damping * t) * (std::cos(rate * t) + damping / rate * std::sin(rate * t));
      const double near = exact(scheme) ? 1e-12 : 0.005 * rate * kCycle;  // a cycle of the swing
      EXPECT_NEAR(sim.x.pos_motor / 10.0 - sim.x.pos_load, twist, near) << t;
      EXPECT_NEAR(50.0 * sim.x.vel_load + 10.0 * sim.x.vel_motor, 0.0, 1e-12) << t;
      EXPECT_NEAR(50.0 * sim.x.pos_load + 10.0 * sim.x.pos_motor, 0.5, 1e-12) << t;
    }
  }
}

// 300 N m/rad under 20 kg m2: w^2 = 15; 12 N m s/rad damp with 0.3 /s. No spring to the load.
TEST(Integration, a_base_that_is_let_go_swings) {
  PlantParams<double> p = simple_plant();
  p.stiffness_1_nm_per_rad = 1e-12;
  p.base = true;
  p.base_inertia_kg_m2 = 20.0;
  p.base_stiffness_nm_per_rad = 300.0;
  p.base_damping_nm_s_per_rad = 12.0;
  const double damping = 0.3, rate = std::sqrt(15.0 - damping * damping);
  for (Scheme scheme : kSchemes) {
    GantrySim<double> sim = at_rest(p, scheme);
    sim.x.pos_base = 0.01;
    for (int k = 1; k <= 10; ++k) {
      pass(sim, 0.1);
      const double t = 0.1 * k;
      EXPECT_NEAR(sim.x.pos_base,
                  0.01 * std::exp(-damping * t) * (std::cos(rate * t) + damping / rate * std::sin(rate * t)),
                  exact(scheme) ? 1e-12 : 0.01 * rate * kCycle)
          << t;
      EXPECT_NEAR(sim.x.pos_load, 0.0, 1e-12);
    }
  }
}

// 3 N m through a current loop of 100 /s on 1.5 kg m2: the speed is 2 rad/s2 x (t - (1 - exp(-100 t)) / 100).
// The first order takes the torque of the start of each cycle.
TEST(Integration, a_slow_current_loop_gives_its_torque_late) {
  PlantParams<double> p = simple_plant();
  p.rigid = true;
  p.current_bandwidth_rad_s = 100.0;
  for (Scheme scheme : kSchemes) {
    GantrySim<double> sim = at_rest(p, scheme);
    pass(sim, 0.02, 3.0);
    const double left = std::exp(-2.0);
    EXPECT_NEAR(sim.x.torque_motor, 3.0 * (1.0 - left), exact(scheme) ? 1e-9 : 1e-12);
    const double vel = 2.0 * (0.02 - (1.0 - left) / 100.0);
    if (exact(scheme))
      EXPECT_NEAR(sim.x.vel_motor, vel, 1e-9);
    else
      // half a cycle of what the acceleration has grown by; the second order is 2.3e-7
      EXPECT_NEAR(sim.x.vel_motor, vel - 0.5 * kCycle * 2.0 * (1.0 - left), 3e-7);
  }
}

// An ideal loop acts in the cycle of its command.
TEST(Integration, an_ideal_current_loop_acts_at_once) {
  PlantParams<double> p = simple_plant();
  p.rigid = true;
  for (Scheme scheme : kSchemes) {
    GantrySim<double> sim = at_rest(p, scheme);
    sim.advance(3.0, kCycle);
    EXPECT_NEAR(sim.x.vel_motor, 2.0 * kCycle, 1e-15);
  }
  p.rigid = false;
  p.second_pinion = true;  // half of it each, on 1 kg m2
  for (Scheme scheme : kSchemes) {
    GantrySim<double> sim = at_rest(p, scheme);
    sim.advance(3.0, kCycle);
    EXPECT_NEAR(sim.x.vel_motor, 1.5 * kCycle, 1e-9);
    EXPECT_NEAR(sim.x.vel_motor_2, 1.5 * kCycle, 1e-9);
  }
}

// Contacts at rest: 1 - exp(-t / T), the rollers in 2 s, the motor in 0.5 s, each where it rubs.
TEST(Integration, contacts_age_at_rest) {
  for (Scheme scheme : kSchemes)
    for (bool rollers : {true, false}) {
      PlantParams<double> p = simple_plant();
      p.ageing = true;
      p.roller_friction = rollers;
      p.motor_friction = !rollers;
      p.roller_ageing_time_s = 2.0;
      p.motor_ageing_time_s = 0.5;
      GantrySim<double> sim = at_rest(p, scheme);
      pass(sim, 1.0);
      EXPECT_NEAR(sim.x.roller_age, rollers ? 1.0 - std::exp(-0.5) : 0.0, 1e-11);
      EXPECT_NEAR(sim.x.motor_age, rollers ? 0.0 : 1.0 - std::exp(-2.0), 1e-11);
      p.ageing = false;
      GantrySim<double> without = at_rest(p, scheme);
      pass(without, 0.1);
      EXPECT_EQ(without.x.roller_age, 0.0);
      EXPECT_EQ(without.x.motor_age, 0.0);
    }
}

// Sliding at 0.1 rad/s, the motor at 1 rad/s, they lose it over 0.05 rad and 2 rad: in equilibrium
// (1 / T) / (1 / T + v / L), which is 0.5 / 2.5 and 2 / 2.5, at the rate of 2.5 /s.
TEST(Integration, contacts_lose_their_age_in_motion) {
  PlantParams<double> p = heavy();
  p.ageing = p.roller_friction = p.motor_friction = true;
  p.roller_coulomb_nm = p.roller_breakaway_nm = p.motor_coulomb_nm = p.motor_breakaway_nm = 1.0;
  p.roller_presliding_rad = p.motor_presliding_rad = 1e-3;
  p.roller_ageing_time_s = 2.0;
  p.motor_ageing_time_s = 0.5;
  p.roller_ageing_length_rad = 0.05;
  p.motor_ageing_length_rad = 2.0;
  for (Scheme scheme : kSchemes) {
    GantrySim<double> sim = at_rest(p, scheme);
    sim.x.vel_load = 0.1;
    sim.x.vel_motor = 1.0;
    sim.x.roller_z = sim.x.motor_z = 1e-3;
    sim.x.roller_age = sim.x.motor_age = 1.0;
    pass(sim, 0.4);
    EXPECT_NEAR(sim.x.roller_age, 0.2 + 0.8 * std::exp(-1.0), 1e-9);
    EXPECT_NEAR(sim.x.motor_age, 0.8 + 0.2 * std::exp(-1.0), 1e-9);
  }
}

// Before anything slides a friction state is the way since it was 0: the motor's own way, that of the load
// against the base for rollers and cables. Hysteresis of 4 N m over 0.1 rad grows by 40 N m per rad of twist.
TEST(Integration, states_of_friction_are_ways) {
  PlantParams<double> p = heavy();
  p.base = p.roller_friction = p.motor_friction = p.cable = p.hysteresis = true;
  p.roller_coulomb_nm = p.roller_breakaway_nm = p.motor_coulomb_nm = p.motor_breakaway_nm = 1.0;
  p.roller_presliding_rad = p.motor_presliding_rad = p.cable_presliding_rad = 0.1;
  p.cable_friction_nm = 1.0;
  p.brake_torque_nm = 1.0;
  p.brake_presliding_rad = 0.1;
  p.hysteresis_torque_nm = 4.0;
  p.hysteresis_length_rad = 0.1;
  for (Scheme scheme : kSchemes) {
    GantrySim<double> sim = at_rest(p, scheme);
    sim.x.vel_motor = 0.05;
    sim.x.vel_load = 0.03;
    sim.x.vel_base = 0.01;
    pass(sim, 0.5);
    EXPECT_NEAR(sim.x.motor_z, 0.025, 1e-12);
    EXPECT_NEAR(sim.x.roller_z, 0.01, 1e-12);
    EXPECT_NEAR(sim.x.cable_z, 0.01, 1e-12);
    EXPECT_NEAR(sim.x.brake_z, 0.0, 1e-12);
    EXPECT_NEAR(sim.x.hysteresis, 40.0 * (0.0025 - 0.01), 1e-9);
    sim.brake.closed = true;
    pass(sim, 0.5);
    EXPECT_NEAR(sim.x.brake_z, 0.025, 1e-8);
  }
}

// 1 rad/s of twist turn a hysteresis of 0.01 mrad over 12.5 times in a cycle: it slides with its 4 N m, and
// turns with the twist. A step of its rate alone would throw it from one side to the other, ever further.
TEST(Integration, a_hysteresis_that_is_turned_over_within_a_cycle_stays_at_its_level) {
  PlantParams<double> p = heavy();
  p.hysteresis = true;
  p.hysteresis_torque_nm = 4.0;
  p.hysteresis_length_rad = 1e-5;
  GantrySim<double> sim = at_rest(p, Scheme::kOneEvaluation);
  for (double side : {1.0, -1.0}) {
    sim.x.vel_load = 0.0;
    sim.x.vel_motor = side * p.ratio;
    for (int k = 0; k < 40; ++k) {
      pass(sim, kCycle);
      EXPECT_LE(std::fabs(sim.x.hysteresis), 4.0);
    }
    EXPECT_NEAR(sim.x.hysteresis, side * 4.0, 1e-9);
  }
}

// A load that has gone leaves more than the level of an empty gear behind: only a twist takes it off.
TEST(Integration, a_hysteresis_beyond_its_level_stays_until_the_gear_moves) {
  PlantParams<double> p = heavy();
  p.hysteresis = true;
  p.hysteresis_torque_nm = 4.0;
  p.hysteresis_length_rad = 1e-5;
  for (double side : {1.0, -1.0}) {
    GantrySim<double> sim = at_rest(p, Scheme::kOneEvaluation);
    sim.x.hysteresis = side * 5.0;
    pass(sim, kCycle);
    EXPECT_EQ(sim.x.hysteresis, side * 5.0);
  }
}

// 400 N m of a slipping brake on 1.5 kg m2.
TEST(Integration, a_slipping_brake_takes_its_torque_from_the_speed) {
  PlantParams<double> p = simple_plant();
  p.rigid = true;
  p.brake_torque_nm = 400.0;
  p.brake_presliding_rad = 1e-3;
  for (Scheme scheme : kSchemes)
    for (double side : {1.0, -1.0}) {
      GantrySim<double> sim = at_rest(p, scheme);
      sim.x.vel_motor = side * 10.0;
      sim.x.brake_z = side * 1e-3;
      pass(sim, 0.01);
      EXPECT_NEAR(sim.x.vel_motor, side * 10.0, 1e-12);
      sim.brake.closed = true;
      pass(sim, 0.01);
      EXPECT_NEAR(sim.x.vel_motor, side * (10.0 - 4.0 / 1.5), 1e-6);
      EXPECT_NEAR(sim.x.brake_z, side * 1e-3, 1e-9);
    }
}

// 30 N m x sin(10 pi t) on 150 kg m2 from the 20th second on, a quarter of a wave of 0.2 s: 0.2 / (10 pi)
// rad/s. The wind is held until the next anchor, on average half of its period late: 0.2 rad/s2 x 0.5 ms for
// one of 1 ms.
TEST(Integration, wind_is_evaluated_once_in_an_anchor_period) {
  PlantParams<double> p = simple_plant();
  p.rigid = p.wind = true;
  p.wind_wave_nm[3] = 30.0;
  p.wind_rate_rad_s[3] = 31.41592653589793;
  for (int scan_ms : {1, 5})
    for (double anchor_s : {1e-6, kCycle, 1e-3}) {
      GantrySim<double> sim(p, {}, 0.0, 0.0,
                            {1e-3 * scan_ms, kCycle, 8 * scan_ms, Scheme::kOneEvaluation, 2, anchor_s});
      sim.static_start(0.0, true);
      sim.scans_done = 20000.0 / scan_ms;
      for (int k = 0; k < 50 / scan_ms; ++k) sim.scan({DriveMode::kOff, 0.0, 0.0}, true);
      const double late = 0.5 * std::max(anchor_s, kCycle);
      EXPECT_NEAR(sim.x.vel_load, 0.2 / 31.41592653589793 - 0.2 * late, 1e-6) << scan_ms << " " << anchor_s;
    }
}

// Gusts begin at nothing.
TEST(Integration, a_cycle_alone_begins_at_the_time_of_its_scan) {
  PlantParams<double> p = simple_plant();
  p.rigid = p.wind = true;
  p.wind_wave_nm[0] = 1e6;
  p.wind_phase_rad[0] = 1.5;
  GantrySim<double> sim = at_rest(p, Scheme::kOneEvaluation);
  sim.advance(0.0, kCycle);
  EXPECT_EQ(sim.x.vel_load, 0.0);
  EXPECT_EQ(sim.timing().anchor_period_s, 1e-3);  // where none was given
}

// Numbers that nothing comes of, and that would cost the processor its time, are zero after a scan.
TEST(Integration, nothing_subnormal_is_kept) {
  DriveParams<double> drive;
  drive.kvp_nm_s_per_rad = 2.0;
  GantrySim<double> sim(simple_plant(), drive, 0.0, 0.0, {1e-3, kCycle, 8, Scheme::kOneEvaluation, 2});
  sim.brake.closed = false;
#define X(name, ...) sim.x.name = 1e-300;
  GANTRY_PLANT_STATE(X)
#undef X
  sim.s.integral = sim.s.vel_filtered = sim.s.torque_set = 1e-300;
  sim.scan({DriveMode::kSpeed, 0.0, 0.0}, true);
#define X(name, ...) EXPECT_EQ(sim.x.name, 0.0) << #name;
  GANTRY_PLANT_STATE(X)
#undef X
  EXPECT_EQ(sim.s.integral, 0.0);
  EXPECT_EQ(sim.s.vel_filtered, 0.0);
  EXPECT_EQ(sim.s.torque_set, 0.0);
}

}  // namespace
}  // namespace gantry
