// Signs and sizes of what acts on motor, load and base, one effect at a time and by hand.
#include <gtest/gtest.h>

#include <cmath>

#include "core/plant/dynamics.hpp"
#include "core/plant/integration.hpp"
#include "example.hpp"

namespace gantry {
namespace {

using State = PlantState<double>;
using example::kQuarter;
using example::simple_plant;

Forces<double> at(const PlantParams<double>& p, const State& x, bool brake_closed = false,
                  double time = 0.0) {
  const Plant<double> plant(p);
  Anchor<double> anchor(p, plant.gear, plant.second_gear, x, time);
  return p.rigid ? forces_rigid(plant, x, anchor, brake_closed) : forces(plant, x, anchor, brake_closed);
}

State wound(double twist) {
  State x;
  x.pos_motor = 10.0 * twist;
  return x;
}

TEST(Forces, spring_goes_through_its_knees) {
  const Plant<double> plant(simple_plant());
  for (const auto& [twist, torque] :
       {std::pair{0.005, 5.0}, {0.01, 10.0}, {0.015, 20.0}, {0.02, 30.0}, {0.03, 70.0}}) {
    EXPECT_NEAR(plant.spring(twist), torque, 1e-9);
    EXPECT_NEAR(plant.windup(torque), twist, 1e-12);
    for (double side : {1.0, -1.0})
      EXPECT_NEAR(at(simple_plant(), wound(side * twist)).torque_mesh, side * torque, 1e-9);
  }
}

TEST(Forces, a_wound_spring_drives_the_load_and_holds_the_motor_back) {
  const auto f = at(simple_plant(), wound(0.005));
  EXPECT_NEAR(f.acc_load, 5.0 / 50.0, 1e-12);
  EXPECT_NEAR(f.first.acc_motor, -5.0 / 10.0, 1e-12);
  PlantParams<double> heavier = simple_plant();
  heavier.inertia_motor_kg_m2 = 2.0;
  EXPECT_NEAR(at(heavier, wound(0.005)).first.acc_motor, -0.5 / 2.0, 1e-12);
}

TEST(Forces, flanks_push_and_do_not_pull) {
  PlantParams<double> p = simple_plant();
  p.backlash = true;
  p.half_backlash_rad = 0.002;
  p.damping_nm_s_per_rad = 100.0;
  EXPECT_EQ(at(p, wound(0.002)).torque_mesh, 0.0);
  EXPECT_NEAR(at(p, wound(0.005)).torque_mesh, 3.0, 1e-9);
  EXPECT_NEAR(at(p, wound(-0.005)).torque_mesh, -3.0, 1e-9);
  EXPECT_NEAR(at(p, wound(0.0025)).torque_mesh, 0.5, 1e-9);
  State x = wound(0.005);
  x.vel_load = 0.1;  // leaves the flank: 3 N m of the spring, 10 N m of the damper against it
  EXPECT_EQ(at(p, x).torque_mesh, 0.0);
}

TEST(Forces, the_base_takes_what_the_ring_gives_the_load) {
  PlantParams<double> p = simple_plant();
  p.base = true;
  p.base_inertia_kg_m2 = 20.0;
  p.base_stiffness_nm_per_rad = 300.0;
  p.base_damping_nm_s_per_rad = 7.0;
  EXPECT_NEAR(at(p, wound(0.005)).acc_base, -5.0 / 20.0, 1e-12);
  State x;
  x.pos_base = x.pos_load = 0.01;
  x.vel_base = x.vel_load = 0.1;
  EXPECT_NEAR(at(p, x).acc_base, (-3.0 - 0.7) / 20.0, 1e-12);
}

// A load that hangs by a quarter turn with 100 N m, gears not wound up: they turn it, none reaches the base.
TEST(Forces, the_base_takes_nothing_of_what_pulls_the_load_alone) {
  PlantParams<double> p = simple_plant();
  p.base = true;
  p.base_inertia_kg_m2 = 20.0;
  p.eccentric_moment_nm = 100.0;
  State x;
  x.pos_load = kQuarter;
  x.pos_motor = 10.0 * kQuarter;
  EXPECT_NEAR(at(p, x).acc_load, 100.0 / 50.0, 1e-9);
  EXPECT_NEAR(at(p, x).acc_base, 0.0, 1e-9);
}

// The load has turned by 2 rad and the base by 0.5: 1.5 rad are between them, of 2 N m each.
TEST(Forces, cables_pull_load_and_base_by_the_angle_between_them) {
  PlantParams<double> p = simple_plant();
  p.base = p.cable = true;
  p.base_inertia_kg_m2 = 20.0;
  p.base_stiffness_nm_per_rad = 0.0;
  p.cable_moment_1_nm = 2.0;
  p.cable_presliding_rad = 1e-3;
  State x;
  x.pos_load = 2.0;
  x.pos_base = 0.5;
  x.pos_motor = 15.0;
  EXPECT_NEAR(at(p, x).acc_load, 3.0 / 50.0, 1e-9);
  EXPECT_NEAR(at(p, x).acc_base, -3.0 / 20.0, 1e-9);
}

TEST(Forces, friction_and_brake_hold_back_in_both_directions) {
  PlantParams<double> p = simple_plant();
  p.motor_friction = p.roller_friction = true;
  p.motor_coulomb_nm = p.motor_breakaway_nm = 2.0;
  p.roller_coulomb_nm = p.roller_breakaway_nm = 20.0;
  p.motor_presliding_rad = p.roller_presliding_rad = p.brake_presliding_rad = 1e-3;
  p.motor_stribeck_rad_s = p.roller_stribeck_rad_s = 1e-3;
  p.brake_torque_nm = 400.0;
  for (double side : {1.0, -1.0}) {
    State x;
    x.vel_motor = side * 10.0;
    x.vel_load = side * 1.0;
    x.motor_z = x.roller_z = x.brake_z = side * 1e-3;  // they slide
    EXPECT_NEAR(at(p, x).first.acc_motor, -side * 2.0, 1e-9);
    EXPECT_NEAR(at(p, x).acc_load, -side * 20.0 / 50.0, 1e-9);
    EXPECT_NEAR(at(p, x, true).first.acc_motor, -side * 402.0, 1e-6);
    PlantParams<double> rigid = p;  // 2 N m of the rollers at the motor
    rigid.rigid = true;
    EXPECT_NEAR(at(rigid, x).first.acc_motor, -side * 4.0 / 1.5, 1e-9);
    EXPECT_NEAR(at(rigid, x, true).first.acc_motor, -side * 404.0 / 1.5, 1e-6);
  }
}

// The eccentric moment of 100 N m, its mean wind of 30 N m and the torque of the motor on one inertia:
// 50 / 10^2 + 1 = 1.5 kg m2 at the motor.
TEST(Forces, rigid_and_elastic_plants_have_the_same_moments) {
  PlantParams<double> p = simple_plant();
  p.eccentric_moment_nm = 100.0;
  p.wind = true;
  p.wind_moment_nm = 30.0;
  State x;
  x.pos_load = kQuarter;
  x.pos_motor = 10.0 * kQuarter;
  x.torque_motor = 2.0;
  EXPECT_NEAR(at(p, x).acc_load, 130.0 / 50.0, 1e-9);
  EXPECT_NEAR(at(p, x).first.acc_motor, 2.0, 1e-9);
  p.rigid = true;
  EXPECT_NEAR(at(p, x).first.acc_motor, (13.0 + 2.0) / 1.5, 1e-9);
  EXPECT_NEAR(at(p, x).acc_load, (13.0 + 2.0) / 15.0, 1e-9);
  EXPECT_NEAR(at(p, x).torque_mesh, 50.0 - 130.0, 1e-9);
}

// What slides steadily stays where it is: the motor with its 2 N m, a tenth of 50 N m in the mesh through the
// ratio of 10 and half of 4 N m of age; the rollers with 20 N m and a quarter of 40 N m.
TEST(Forces, load_and_age_raise_the_friction) {
  PlantParams<double> p = simple_plant();
  p.motor_friction = p.roller_friction = true;
  p.motor_coulomb_nm = p.motor_breakaway_nm = 2.0;
  p.roller_coulomb_nm = p.roller_breakaway_nm = 20.0;
  p.motor_presliding_rad = p.roller_presliding_rad = 1e-3;
  p.motor_stribeck_rad_s = p.roller_stribeck_rad_s = 1e-3;
  p.motor_load_ratio = 0.1;
  p.motor_ageing_nm = 4.0;
  p.roller_ageing_nm = 40.0;
  for (double side : {1.0, -1.0}) {
    State x = wound(side * 0.025);
    x.vel_motor = 10.0;
    x.vel_load = 1.0;
    x.motor_age = 0.5;
    x.roller_age = 0.25;
    for (bool aged : {true, false}) {
      p.ageing = aged;
      x.motor_z = (aged ? 4.5 : 2.5) / 2000.0;
      x.roller_z = (aged ? 30.0 : 20.0) / 20000.0;
      EXPECT_NEAR(at(p, x).first.motor.z_rate, 0.0, 1e-9);
      EXPECT_NEAR(at(p, x).roller.z_rate, 0.0, 1e-9);
    }
  }
}

// At 10 K viscous friction is 1.3 times as much, of motor and rollers.
TEST(Forces, cold_gears_are_harder_to_turn) {
  PlantParams<double> p = simple_plant();
  p.motor_friction = p.roller_friction = true;
  p.motor_viscous_nm_s_per_rad = 5.0;
  p.roller_viscous_nm_s_per_rad = 50.0;
  p.gear_temp_start_k = p.gear_temp_end_k = -10.0;
  p.viscosity_per_k = -0.1 * std::log(1.3);
  State x;
  x.vel_motor = 2.0;
  x.vel_load = 0.2;
  for (const auto& [thermal, torque] : {std::pair{false, 10.0}, {true, 13.0}}) {
    p.thermal = thermal;
    EXPECT_NEAR(at(p, x).first.motor.torque, torque, 1e-9);
    EXPECT_NEAR(at(p, x).roller.torque, torque, 1e-9);
  }
}

// Gears from 2 K towards -4 K, the motor from 0 towards 60 K, 1 - exp(-1) of the way after a time constant.
TEST(Forces, temperatures_act_with_their_signs) {
  PlantParams<double> p = simple_plant();
  p.thermal = p.backlash = true;
  p.half_backlash_rad = 1e-3;
  p.half_backlash_rad_per_k = -1e-4;  // warm gears close the gap
  p.gear_temp_start_k = 2.0;
  p.gear_temp_end_k = -4.0;
  p.gear_temp_time_s = p.motor_temp_time_s = 100.0;
  p.motor_temp_end_k = 60.0;
  p.torque_constant_per_k = -0.001;
  p.viscosity_per_k = -0.05;
  const Thermal<double> begin(p, 0.0), later(p, 100.0), end(p, 1e5);
  EXPECT_NEAR(begin.half_backlash, 0.8e-3, 1e-15);
  EXPECT_NEAR(begin.viscosity, std::exp(-0.1), 1e-12);
  EXPECT_NEAR(begin.motor_torque, 1.0, 1e-12);
  EXPECT_NEAR(later.motor_torque, 1.0 - 0.06 * 0.632120559, 1e-9);
  const double gears = 2.0 - 6.0 * 0.632120559;
  EXPECT_NEAR(later.half_backlash, 1e-3 - 1e-4 * gears, 1e-12);
  EXPECT_NEAR(later.viscosity, std::exp(-0.05 * gears), 1e-9);
  p.half_backlash_rad = 1e-4;
  EXPECT_EQ(Thermal<double>(p, 0.0).half_backlash, 0.0);  // and no less
  p.half_backlash_rad = 1e-3;
  EXPECT_NEAR(end.half_backlash, 1.4e-3, 1e-12);
  EXPECT_NEAR(end.motor_torque, 0.94, 1e-9);
  State x;
  x.torque_motor = 10.0;
  EXPECT_NEAR(at(p, x, false, 1e5).first.acc_motor, 9.4, 1e-9);
}

// The drive believes in 10 N m; the motor has 3 % less of torque constant, and loses as much again by 30 K.
TEST(Forces, a_weak_motor_gives_less_than_its_drive_believes) {
  PlantParams<double> p = simple_plant();
  p.torque_constant = true;
  p.torque_constant_ratio = 0.97;
  State x;
  x.torque_motor = 10.0;
  EXPECT_NEAR(at(p, x, false, 0.0).first.acc_motor, 9.7, 1e-12);
  p.thermal = true;
  p.motor_temp_start_k = p.motor_temp_end_k = 30.0;
  p.torque_constant_per_k = -0.001;
  EXPECT_NEAR(at(p, x, false, 0.0).first.acc_motor, 9.7 * 0.97, 1e-12);
}

// At 30 % more viscosity 5 N m s/rad hold back by 3 N m more at 2 rad/s.
TEST(Forces, cold_grease_holds_back_more_in_both_directions) {
  FrictionParams<double> p;
  p.viscous = 5.0;
  Thermal<double> cold(simple_plant(), 0.0);
  EXPECT_EQ(cold.viscosity, 1.0);
  cold.viscosity = 1.3;
  for (double side : {1.0, -1.0}) {
    Friction<double> f;
    f.torque = side * 10.0;
    thicken(p, cold, side * 2.0, f);
    EXPECT_NEAR(f.torque, side * 13.0, 1e-12);
  }
}

// 1 + 2 x + 3 x^2 + 4 x^3 is 49 at 2 rad; 6 N m of friction of the cables are against the motion.
TEST(Forces, cables_pull_by_their_angle_and_hold_back) {
  PlantParams<double> p = simple_plant();
  p.cable = true;
  p.cable_moment_nm = 1.0;
  p.cable_moment_1_nm = 2.0;
  p.cable_moment_2_nm = 3.0;
  p.cable_moment_3_nm = 4.0;
  p.cable_friction_nm = 6.0;
  p.cable_presliding_rad = 1e-3;
  for (double side : {1.0, -1.0}) {
    State x;
    x.pos_load = 2.0;
    x.pos_motor = 20.0;
    x.vel_load = side * 1.0;
    x.vel_motor = side * 10.0;
    x.cable_z = side * 1e-3;  // they slide
    p.rigid = false;
    EXPECT_NEAR(at(p, x).acc_load, (49.0 - side * 6.0) / 50.0, 1e-9);
    p.rigid = true;
    EXPECT_NEAR(at(p, x).first.acc_motor, (4.9 - side * 0.6) / 1.5, 1e-9);
  }
}

TEST(Forces, what_is_switched_off_does_not_act) {
  State x = wound(0.005);
  x.hysteresis = 0.0;
  x.vel_motor = 3.0;
  const auto f = at(simple_plant(), x);
  EXPECT_EQ(f.first.hysteresis_rate, 0.0);
  EXPECT_EQ(f.acc_base, 0.0);
  for (const Friction<double>& none : {f.roller, f.cable, f.first.motor, f.first.brake, f.second.motor})
    for (double each : {none.torque, none.z_rate, none.slip_rate}) EXPECT_EQ(each, 0.0);
  const Plant<double> plant(simple_plant());
  MotorWaves<double> waves;
  EXPECT_EQ(motor_side(plant, plant.gear, waves, 0.3).ripple, 0.0);
  EXPECT_EQ(motor_side(plant, plant.gear, waves, 0.3).cogging, 0.0);
  PlantParams<double> rigid = simple_plant();
  rigid.rigid = true;
  for (const auto& none : {f.second, at(rigid, x).second})  // a pinion that is not there
    for (double each : {none.acc_motor, none.torque_mesh, none.on_ring, none.hysteresis_rate})
      EXPECT_EQ(each, 0.0);
  const auto on_one_shaft = at(rigid, x).first;  // no mesh between motor and load
  for (double each : {on_one_shaft.torque_mesh, on_one_shaft.on_ring, on_one_shaft.hysteresis_rate})
    EXPECT_EQ(each, 0.0);
}

// 4 kN m/rad of a brake of 2 N m over 0.5 mrad on 1 kg m2: 1.4 sqrt(4000) N m s/rad damp it before it slips;
// cables have no damping.
TEST(Forces, a_brake_is_damped_before_it_slips_and_cables_are_not) {
  PlantParams<double> p = simple_plant();
  p.brake_torque_nm = 2.0;
  p.brake_presliding_rad = 5e-4;
  p.cable = true;
  p.cable_friction_nm = 6.0;
  p.cable_presliding_rad = 1e-3;
  State x;
  x.vel_motor = 1e-3;
  x.vel_load = 1e-9;
  EXPECT_NEAR(at(p, x, true).first.brake.torque, 1.4 * std::sqrt(4000.0) * 1e-3, 1e-12);
  EXPECT_EQ(at(p, x).cable.torque, 0.0);
}

// At the end of the gap, and of none, nothing is transmitted.
TEST(Forces, a_flank_that_is_only_touched_does_not_push) {
  PlantParams<double> p = simple_plant();
  p.backlash = p.hysteresis = true;
  p.hysteresis_torque_nm = 4.0;
  State x;
  x.hysteresis = 3.0;
  EXPECT_EQ(at(p, x).torque_mesh, 0.0);
  EXPECT_NEAR(at(p, x).first.hysteresis_rate, -300.0, 1e-9);
}

// 4 N m of hysteresis and a tenth of 20 N m in the spring, over 1 mrad: at 0.5 rad/s and no hysteresis yet it
// grows by 6 N m x 0.5 / 1e-3 in a second; when it has come to 6 N m it grows no more.
TEST(Forces, hysteresis_grows_up_to_its_level) {
  PlantParams<double> p = simple_plant();
  p.hysteresis = true;
  p.hysteresis_torque_nm = 4.0;
  p.hysteresis_load_ratio = 0.1;
  p.hysteresis_length_rad = 1e-3;
  for (double side : {1.0, -1.0}) {
    State x = wound(side * 0.015);
    x.vel_motor = side * 5.0;
    EXPECT_NEAR(at(p, x).first.hysteresis_rate, side * 3000.0, 1e-6);
    EXPECT_NEAR(at(p, x).torque_mesh, side * 20.0, 1e-9);
    x.hysteresis = side * 6.0;
    EXPECT_NEAR(at(p, x).first.hysteresis_rate, 0.0, 1e-6);
    EXPECT_NEAR(at(p, x).torque_mesh, side * 26.0, 1e-9);
    PlantParams<double> halfway = p;  // between half of the level and all of it the sine is in its middle
    halfway.friction_ep_ratio = 0.5;
    x.hysteresis = side * 4.5;
    EXPECT_NEAR(at(halfway, x).first.hysteresis_rate, side * (6.0 - 0.5 * 4.5) * 0.5 / 1e-3, 1e-6);
    PlantParams<double> flank = p;  // on its flank as without a gap
    flank.backlash = true;
    x.hysteresis = 0.0;
    EXPECT_NEAR(at(flank, x).first.hysteresis_rate, side * 3000.0, 1e-6);
  }
}

// In the gap the hysteresis is lost within 10 ms.
TEST(Forces, hysteresis_decays_in_the_gap) {
  PlantParams<double> p = simple_plant();
  p.hysteresis = p.backlash = true;
  p.hysteresis_torque_nm = 4.0;
  p.hysteresis_length_rad = 1e-3;
  p.half_backlash_rad = 0.01;
  State x = wound(0.005);
  x.hysteresis = 3.0;
  x.vel_motor = 5.0;
  EXPECT_NEAR(at(p, x).first.hysteresis_rate, -300.0, 1e-9);
  EXPECT_EQ(at(p, x).torque_mesh, 0.0);
}

// Full from 20 N m on: a wave of 2 N m, three times a turn of the motor, at 10 N m by half.
TEST(Forces, ripple_grows_with_the_torque_up_to_its_amplitude) {
  PlantParams<double> p = simple_plant();
  p.ripple = p.rigid = true;
  p.ripple_torque_nm = 2.0;
  p.ripple_full_torque_nm = 20.0;
  for (int order : {3, 12}) {
    p.ripple_order = order;
    for (const auto& [torque, size] :
         {std::pair{10.0, 1.0}, {-10.0, 1.0}, {20.0, 2.0}, {25.0, 2.0}, {40.0, 2.0}}) {
      State x;
      x.pos_motor = kQuarter / order;
      x.pos_load = x.pos_motor / 10.0;
      x.torque_motor = torque;
      EXPECT_NEAR(at(p, x).first.acc_motor, (torque + size) / 1.5, 1e-9);
      x.pos_motor = kQuarter / order / 3.0;  // 30 deg of the wave: half of it
      x.pos_load = x.pos_motor / 10.0;
      EXPECT_NEAR(at(p, x).first.acc_motor, (torque + 0.5 * size) / 1.5, 1e-9);
    }
  }
}

// A wave of 2 N m, three or twelve times a turn of the motor, at its top.
TEST(Forces, cogging_turns_the_motor) {
  PlantParams<double> p = simple_plant();
  p.cogging = p.rigid = true;
  p.cogging_torque_nm = 2.0;
  for (int order : {3, 12}) {
    p.cogging_order = order;
    State x;
    x.pos_motor = kQuarter / order;
    x.pos_load = x.pos_motor / 10.0;
    EXPECT_NEAR(at(p, x).first.acc_motor, 2.0 / 1.5, 1e-9);
  }
}

// An error of 5 mrad winds the spring up; where it is only beginning, 5 mrad per radian, it changes the ratio
// of 0.1 or 1 by which speeds come to the mesh and its torque goes back: a damper of 100 N m s/rad, 1 rad/s
// of one side.
TEST(Forces, errors_of_the_gears_wind_the_spring_and_change_the_ratio) {
  PlantParams<double> p = simple_plant();
  p.gear_error = true;
  p.damping_nm_s_per_rad = 100.0;
  p.error_ring_rad[0] = 0.005;
  p.phase_ring_rad[0] = kQuarter;
  EXPECT_NEAR(at(p, State()).torque_mesh, 5.0, 1e-9);
  p.phase_ring_rad[0] = 0.0;
  State x;
  x.vel_load = 1.0;
  EXPECT_NEAR(at(p, x).torque_mesh, -99.5, 1e-9);
  EXPECT_NEAR(at(p, x).acc_load, -99.5 * 0.995 / 50.0, 1e-9);
  p.error_ring_rad[0] = 0.0;
  p.error_reducer_1x_rad = 0.005;
  State turning;
  turning.vel_motor = 1.0;
  EXPECT_NEAR(at(p, turning).torque_mesh, 10.5, 1e-9);
  EXPECT_NEAR(at(p, turning).first.acc_motor, -10.5 * 0.105, 1e-9);
  p.error_reducer_1x_rad = 0.0;
  p.error_pinion_rad = 0.005;
  p.phase_pinion_rad = kQuarter;
  EXPECT_NEAR(at(p, State()).torque_mesh, 5.0, 1e-9);
}

// Two teeth of the pinion, which turns half as fast as the motor, 4 mrad apart: half of it in the middle of
// the passage, with 1.875 / pi of it per radian of the motor.
TEST(Forces, errors_of_single_teeth_wind_the_spring_and_change_the_ratio) {
  PlantParams<double> p = simple_plant();
  p.tooth_pitch = true;
  p.ring_teeth = 4;
  p.pinion_teeth = 2;
  p.reducer_ratio = 2.0;
  p.contact_ratio = 1.5;
  p.pitch.pinion_rad[1] = 4e-3;
  p.damping_nm_s_per_rad = 100.0;
  State x;
  x.pos_motor = 3.0 * kQuarter;
  x.pos_load = 0.3 * kQuarter;
  EXPECT_NEAR(at(p, x).torque_mesh, 2.0, 1e-9);
  x.vel_motor = 1.0;
  const double ratio = 0.1 + 4e-3 * 1.875 / (2.0 * kQuarter);
  EXPECT_NEAR(at(p, x).torque_mesh, 2.0 + 100.0 * ratio, 1e-9);
  EXPECT_NEAR(at(p, x).first.acc_motor, -(2.0 + 100.0 * ratio) * ratio, 1e-9);
  x.vel_motor = 0.0;
  p.pitch.ring_rad[0] = 1e-3;
  EXPECT_NEAR(at(p, x).torque_mesh, 3.0, 1e-9);
}

// Bandwidth 1000 /s: after 1 ms exp(-1) of the difference is left.
TEST(CurrentLoop, torque_goes_towards_its_command) {
  PlantParams<double> p = simple_plant();
  p.current_bandwidth_rad_s = 1000.0;
  const CurrentLoop<double> loop(p, 1e-3);
  EXPECT_NEAR(loop.at_start(10.0, 4.0), 4.0, 1e-12);
  EXPECT_NEAR(loop.at_end(10.0, 4.0), 10.0 - 6.0 * 0.367879441, 1e-8);
  p.current_bandwidth_rad_s = 0.5;
  EXPECT_EQ(CurrentLoop<double>(p, 1e-3).at_start(10.0, 4.0), 4.0);
  EXPECT_NEAR(CurrentLoop<double>(p, 1e-3).at_end(10.0, 4.0), 10.0 - 6.0 * std::exp(-5e-4), 1e-12);
  PlantParams<Pack<2>> side_by_side;
  side_by_side.current_bandwidth_rad_s = 0.5;
  set_lane(side_by_side.current_bandwidth_rad_s, 1, 0.0);
  const Pack<2> torque = CurrentLoop<Pack<2>>(side_by_side, 1e-3).at_start(10.0, 4.0);
  EXPECT_EQ(lane(torque, 0), 4.0);
  EXPECT_EQ(lane(torque, 1), 10.0);
  p.current_bandwidth_rad_s = 0.0;
  const CurrentLoop<double> ideal(p, 1e-3);
  EXPECT_EQ(ideal.at_end(10.0, ideal.at_start(10.0, 4.0)), 10.0);
}

}  // namespace
}  // namespace gantry
