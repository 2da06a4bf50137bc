// Two pinions on one ring: how the loop's torque is shared, what equals what with one, what the preload and
// the loss of a motor do. Balances by hand, one effect at a time.
#include <gtest/gtest.h>

#include <cmath>

#include "example.hpp"

namespace gantry {
namespace {

using Sim = GantrySim<double>;

// One loop for two: 100 N m rated, 150 N m each at most, gain 2 N m s/rad; the torque acts at once.
DriveParams<double> loop_of_two(double preload) {
  DriveParams<double> p;
  p.kvp_nm_s_per_rad = 2.0;
  p.tvi_s = 1e9;
  p.torque_rated_nm = 100.0;
  p.torque_max_nm = 150.0;
  p.overload_time_s = 4.0;
  p.preload_nm = preload;
  p.two_motors = true;
  return p;
}

MotorTorques<double> asked(const DriveParams<double>& p, double torque, bool& limited,
                           DriveMode mode = DriveMode::kSpeed) {
  const Drive<double> drive(p);
  DriveState<double> s;
  return drive_cycle(drive, {mode, 0.0, torque}, s, 0.0, 0.0, limited);
}

TEST(TwoMotors, share_the_torque_of_the_loop_and_pull_against_each_other) {
  bool limited = false;
  for (const auto& [torque, preload, first, second, cut] :
       {std::tuple{80.0, 0.0, 40.0, 40.0, false},
        {80.0, 30.0, 70.0, 10.0, false},
        {-80.0, 30.0, -10.0, -70.0, false},
        {80.0, -30.0, 10.0, 70.0, false},
        // The first has its limit, the second goes on to its own; then there is no more.
        {240.0, 30.0, 150.0, 90.0, false},
        {250.0, 30.0, 150.0, 95.0, true},
        {250.0, -30.0, 95.0, 150.0, true},
        {-250.0, 30.0, -95.0, -150.0, true},
        {360.0, 30.0, 150.0, 150.0, true},
        {999.0, 0.0, 150.0, 150.0, true},
        {999.0, 30.0, 150.0, 150.0, true},
        {999.0, -30.0, 150.0, 150.0, true},
        {-999.0, 30.0, -150.0, -150.0, true},
        {-999.0, -30.0, -150.0, -150.0, true}}) {
    limited = false;
    const MotorTorques<double> u = asked(loop_of_two(preload), torque, limited);
    EXPECT_NEAR(u.first, first, 1e-12) << torque;
    EXPECT_NEAR(u.second, second, 1e-12) << torque;
    EXPECT_EQ(limited, cut) << torque;
  }
  DriveState<double> s;  // the loop itself asks for no more than both have with their preload
  drive_cycle(Drive<double>(loop_of_two(30.0)), {DriveMode::kSpeed, 0.0, 999.0}, s, 0.0, 0.0, limited);
  EXPECT_NEAR(s.torque_set, 360.0, 1e-12);
}

TEST(TwoMotors, have_no_preload_while_the_drive_is_off) {
  bool limited = false;
  const MotorTorques<double> u = asked(loop_of_two(30.0), 80.0, limited, DriveMode::kOff);
  EXPECT_EQ(u.first, 0.0);
  EXPECT_EQ(u.second, 0.0);
  EXPECT_FALSE(limited);
}

// (100/2 + 90)/100 = 1.4 of the rated torque in one of them: its budget of 4 s (1.5^2 - 1) lasts 5 s/(1.4^2 -
// 1).
TEST(TwoMotors, are_limited_by_the_account_of_the_one_that_has_more) {
  for (const auto& [torque, preload] : {std::pair{100.0, 90.0}, {-100.0, 90.0}, {100.0, -90.0}}) {
    const Drive<double> drive(loop_of_two(preload));
    DriveState<double> s;
    bool limited = false;
    double time = 0.0;
    for (; time < 10.0 && !limited; time += drive.p.cycle_s)
      drive_cycle(drive, {DriveMode::kSpeed, 0.0, torque}, s, 0.0, 0.0, limited);
    EXPECT_NEAR(time, 5.0 / 0.96, 0.01);
  }
}

// The preload of half the rated torque flows while the loop is closed and asks for nothing: of the account of
// 5 s a second of it takes 1 - 0.5^2; switched off, the whole second. 8000 cycles round by 1e-12.
TEST(TwoMotors, without_power_cool_down_by_all_of_the_time) {
  for (const auto& [mode, left_s] : {std::pair{DriveMode::kSpeed, 4.25}, {DriveMode::kOff, 4.0}}) {
    const Drive<double> drive(loop_of_two(-50.0));
    DriveState<double> s;
    s.overload = drive.budget_s;
    bool limited = false;
    for (int k = 0; k < 8000; ++k) drive_cycle(drive, {mode, 0.0, 0.0}, s, 0.0, 0.0, limited);
    EXPECT_NEAR(s.overload, left_s, 1e-9);
  }
}

// Smooth enough for balances by hand: no gear error, no friction, no base, one slope of 5.12e8 N m/rad.
PlantParams<double> smooth(bool two) {
  PlantParams<double> p = example::plant();
  p.gear_error = p.hysteresis = p.roller_friction = p.motor_friction = p.base = p.ripple = false;
  p.torque_1_nm = 1e9;
  p.torque_2_nm = 2e9;
  p.second_pinion = two;
  return p;
}

DriveParams<double> servo(double preload = 0.0) {
  DriveParams<double> d = example::drive();
  d.preload_nm = preload;
  d.speed_count_rad = d.position_count_rad = 0.0;
  return d;
}

void run(Sim& sim, double speed, int scans) {
  for (int k = 0; k < scans; ++k) sim.scan({DriveMode::kSpeed, speed, 0.0}, true);
}

// Twice the rotor, torque limit, friction, ripple, stiffness, damping and hysteresis, and where it bends at
// twice the torque: that is one train which does what two equal ones do at the same place of the ring.
PlantParams<double> doubled(PlantParams<double> p) {
  for (double* each :
       {&p.inertia_motor_kg_m2, &p.stiffness_1_nm_per_rad, &p.stiffness_2_nm_per_rad,
        &p.stiffness_3_nm_per_rad, &p.torque_1_nm, &p.torque_2_nm, &p.damping_nm_s_per_rad,
        &p.hysteresis_torque_nm, &p.motor_coulomb_nm, &p.motor_breakaway_nm, &p.motor_viscous_nm_s_per_rad,
        &p.ripple_torque_nm, &p.ripple_full_torque_nm, &p.cogging_torque_nm, &p.motor_ageing_nm})
    *each *= 2.0;
  return p;
}

TEST(TwoPinions, at_one_place_and_without_preload_are_one_of_twice_the_size) {
  for (const bool beyond : {false, true})
    for (const Scheme scheme : {Scheme::kOneEvaluation, Scheme::kRungeKutta4}) {
      PlantParams<double> p = beyond ? example::beyond(example::plant()) : example::plant();
      p.second_angle_rad = 0.0;
      p.second_phase_reducer_2x_rad = p.phase_reducer_2x_rad;
      p.second_phase_reducer_1x_rad = p.phase_reducer_1x_rad;
      p.second_phase_reducer_4x_rad = p.phase_reducer_4x_rad;
      p.second_phase_pinion_rad = p.phase_pinion_rad;
      p.second_phase_mesh_rad = p.phase_mesh_rad;
      p.pitch.second_pinion_rad = p.pitch.pinion_rad;
      DriveParams<double> d = example::drive(), twice = d;
      d.preload_nm = 0.0;
      twice.torque_max_nm *= 2.0;
      twice.torque_rated_nm *= 2.0;
      Sim two = example::sim(example::on_two_pinions(p), d, scheme);
      Sim one = example::sim(doubled(p), twice, scheme);
      for (Sim* sim : {&two, &one}) sim->static_start(0.4, true);
      // From the same state: two begin with their friction bent by what the slope of the gear error asks for.
      two.x = one.x;
      two.s = one.s;
      two.x.torque_motor *= 0.5;
      two.x.pos_motor_2 = two.x.pos_motor;
      two.x.torque_motor_2 = two.x.torque_motor;
      two.x.motor_age_2 = two.x.motor_age;
      for (Sim* sim : {&two, &one}) {
        run(*sim, 60.0, 150);   // into the torque limit
        run(*sim, -20.0, 150);  // through the gap
        for (int k = 0; k < 100; ++k) sim->scan({DriveMode::kQuickStop, 0.0, 0.0}, true);
      }
      // Factors of two round nothing; sums in another order do, 1e-16 of an angle of 500 rad in a step of
      // 1e-4.
      EXPECT_NEAR(two.x.pos_load, one.x.pos_load, 1e-11);
      EXPECT_NEAR(two.x.pos_motor, one.x.pos_motor, 1e-8);
      EXPECT_NEAR(two.x.pos_motor_2, one.x.pos_motor, 1e-8);
      EXPECT_NEAR(two.torque_act(), one.torque_act(), 1e-4);
      EXPECT_NEAR(2.0 * two.torque_mesh(), one.torque_mesh(), 1.0);
      EXPECT_NEAR(two.overload(), one.overload(), 1e-9);
      EXPECT_GT(std::fabs(one.x.pos_load - 0.4), 1e-3);
    }
}

// 16 kN m at 90 deg: without preload half of it on each; with 20 N m, 1144 x 20 = 22.88 kN m more and less,
// so the second carries on its other flank and no gap is open.
TEST(TwoPinions, stand_in_balance_with_preload) {
  const double load = 15990.3;
  for (const auto& [preload, scheme] : {std::pair{0.0, Scheme::kOneEvaluation},
                                        {20.0, Scheme::kOneEvaluation},
                                        {3.0, Scheme::kOneEvaluation},
                                        {20.0, Scheme::kRungeKutta4}}) {
    Sim sim = example::sim(smooth(true), servo(preload), scheme);
    sim.static_start(1.5707963267948966, true);
    const PlantState<double> start = sim.x;
    EXPECT_NEAR(sim.x.torque_motor, 0.5 * load / 1144.0 + preload, 1e-9);
    EXPECT_NEAR(sim.x.torque_motor_2, 0.5 * load / 1144.0 - preload, 1e-9);
    EXPECT_NEAR(sim.torque_act(), load / 1144.0, 1e-9);
    const double tighter = 2.0 * preload * 1144.0 / 5.12e8;  // wind-up between the two
    const double gap = preload == 20.0 ? 2.0 * 1.0566e-5 : 0.0;
    EXPECT_NEAR((sim.x.pos_motor - sim.x.pos_motor_2) / 1144.0, tighter + gap, 1e-9);
    EXPECT_NEAR(sim.torque_mesh(), 0.5 * load + 1144.0 * preload, 1e-6);
    run(sim, 0.0, 500);
    EXPECT_NEAR(sim.x.pos_load, start.pos_load, 1e-9);
    EXPECT_NEAR(sim.x.pos_motor_2, start.pos_motor_2, 1e-6);
    EXPECT_NEAR(sim.x.torque_motor_2, start.torque_motor_2, 1e-3);
  }
}

// Errors of 5 mrad wind the spring of the second by 5 N m: of the ring a quarter turn further on, of its own
// gears by their own phases.
TEST(TwoPinions, have_the_errors_of_their_own_place_and_gears) {
  using Params = PlantParams<double>;
  Params p = example::simple_plant();
  p.second_pinion = p.gear_error = true;
  const auto expect_second = [](const Params& params) {
    const Plant<double> plant(params);
    const PlantState<double> x;
    Anchor<double> anchor(params, plant.gear, plant.second_gear, x, 0.0);
    const Forces<double> f = forces<true>(plant, x, anchor, false);
    EXPECT_NEAR(f.first.torque_mesh, 0.0, 1e-9);
    EXPECT_NEAR(f.second.torque_mesh, 5.0, 1e-9);
  };
  Params ring = p;
  ring.error_ring_rad[0] = 0.005;
  ring.second_angle_rad = 1.5707963267948966;
  expect_second(ring);
  for (const auto& [error, phase] :
       {std::pair{&Params::error_reducer_2x_rad, &Params::second_phase_reducer_2x_rad},
        {&Params::error_reducer_1x_rad, &Params::second_phase_reducer_1x_rad},
        {&Params::error_reducer_4x_rad, &Params::second_phase_reducer_4x_rad},
        {&Params::error_pinion_rad, &Params::second_phase_pinion_rad},
        {&Params::error_mesh_rad, &Params::second_phase_mesh_rad}}) {
    Params gears = p;
    gears.*error = 0.005;
    gears.*phase = 1.5707963267948966;
    expect_second(gears);
  }
}

// Motors of 0.8 of the torque that the drive believes in are asked for a quarter more.
TEST(TwoPinions, ask_weak_motors_for_more) {
  for (const bool warm : {true, false}) {
    PlantParams<double> p = smooth(true);
    p.thermal = warm;
    p.motor_temp_start_k = 20.0;
    p.torque_constant_per_k = -0.01;
    p.half_backlash_rad_per_k = 0.0;
    p.torque_constant = !warm;
    p.torque_constant_ratio = warm ? 1.0 : 0.8;
    Sim sim = example::sim(p, servo(20.0));
    sim.static_start(1.5707963267948966, true);
    EXPECT_NEAR(sim.x.torque_motor, 0.5 * 15990.3 / 1144.0 / 0.8 + 20.0, 1e-9);
    EXPECT_NEAR(sim.x.torque_motor_2, 0.5 * 15990.3 / 1144.0 / 0.8 - 20.0, 1e-9);
  }
}

// 20 N m each way, 22.88 kN m at the gantry, on the first and against it on the second: shown is the first.
TEST(TwoPinions, show_the_one_that_carries_more_and_the_first_of_equal_ones) {
  PlantParams<double> p = smooth(true);
  p.eccentric_moment_nm = 0.0;
  Sim sim = example::sim(p, servo(20.0));
  sim.static_start(0.0, true);
  EXPECT_NEAR(sim.torque_mesh(), 22880.0, 1e-6);
  p.second_angle_rad = 0.0;
  const Plant<double> plant(p);
  PlantState<double> x;
  x.pos_motor = 0.1;
  x.pos_motor_2 = -0.1;
  Anchor<double> anchor(p, plant.gear, plant.second_gear, x, 0.0);
  const Forces<double> f = forces<true>(plant, x, anchor, false);
  EXPECT_EQ(f.torque_mesh, f.first.torque_mesh);
  EXPECT_EQ(f.second.torque_mesh, -f.first.torque_mesh);
  EXPECT_GT(f.torque_mesh, 0.0);
  x.pos_motor_2 = -0.2;
  EXPECT_EQ(forces<true>(plant, x, anchor, false).torque_mesh,
            forces<true>(plant, x, anchor, false).second.torque_mesh);
  x.pos_motor = -0.2;
  x.pos_motor_2 = 0.1;
  EXPECT_EQ(forces<true>(plant, x, anchor, false).torque_mesh,
            forces<true>(plant, x, anchor, false).first.torque_mesh);
  for (const double side : {1.0, -1.0}) {  // a load of 2 N m of the motor beside 20 N m of preload
    p.eccentric_moment_nm = -side * 2288.0;
    Sim loaded = example::sim(p, servo(20.0));
    loaded.static_start(1.5707963267948966, true);
    EXPECT_NEAR(loaded.torque_mesh(), side * 21.0 * 1144.0, 1e-6);
  }
  p.eccentric_moment_nm = 2288.0;
  Sim other = example::sim(p, servo(-20.0));
  other.static_start(1.5707963267948966, true);
  EXPECT_NEAR(other.torque_mesh(), -21.0 * 1144.0, 1e-6);
}

// The brake is on the first: it has all of the load and no preload. What has stood is old.
TEST(TwoPinions, stand_on_the_brake_of_the_first) {
  PlantParams<double> p = smooth(true);
  p.ageing = true;
  Sim sim = example::sim(p, servo(20.0));
  sim.static_start(1.5707963267948966, false);
  EXPECT_NEAR(sim.torque_mesh(), 15990.3, 1e-9);
  EXPECT_NEAR(sim.x.brake_z, -15990.3 / 1144.0 / 8e5, 1e-12);
  EXPECT_EQ(sim.x.motor_age_2, 1.0);
}

// A motor whose error of 5 mrad grows turns the load by more than 1/10, and needs as much more torque.
TEST(TwoPinions, need_the_torque_that_the_slope_of_their_errors_asks_for) {
  PlantParams<double> p = example::simple_plant();
  p.second_pinion = p.gear_error = true;
  p.eccentric_moment_nm = -20.0;
  p.error_reducer_1x_rad = 0.005;
  p.lost_motor = 2;
  Sim sim = example::sim(p, servo(0.0));
  sim.static_start(1.5707963267948966, true);
  EXPECT_NEAR(sim.x.torque_motor, 20.0 * (0.1 + 0.005 * std::cos(sim.x.pos_motor)), 1e-9);
  EXPECT_GT(std::fabs(std::cos(sim.x.pos_motor)), 0.1);
  p.gear_error = false;
  p.tooth_pitch = true;
  p.ring_teeth = 4;
  p.pinion_teeth = 2;
  p.contact_ratio = 2.0;  // always passing from one tooth to the next
  p.pitch.pinion_rad[1] = 4e-3;
  Sim teeth = example::sim(p, servo(0.0));
  teeth.static_start(1.5707963267948966, true);
  const double slope = pinion_pitch_error(p, teeth.x.pos_motor).slope;
  EXPECT_NEAR(teeth.x.torque_motor, 20.0 * (0.1 + slope), 1e-9);
  EXPECT_GT(std::fabs(slope), 1e-5);
}

// How far the load can be turned while both motors are held: spring alone where a preload closes the gaps,
// spring and gap where it does not. M turns the load by M / 2K without a gap, by b and M / 2K with it.
double slack(double preload, double moment) {
  PlantParams<double> p = smooth(true);
  p.eccentric_moment_nm = moment;
  p.eccentric_angle_rad = -1.5707963267948966;  // the moment of the load is `moment` at 0
  DriveParams<double> d = servo(preload);
  double angle[2] = {0.0, 0.0};
  for (int side : {0, 1}) {
    p.eccentric_moment_nm = side == 0 ? moment : -moment;
    Sim sim = example::sim(p, d);
    sim.static_start(0.0, true);
    angle[side] = 0.5 * (sim.x.pos_motor + sim.x.pos_motor_2) / 1144.0;  // rho is 0
  }
  return angle[1] - angle[0];
}

TEST(TwoPinions, lose_no_motion_where_the_preload_is_more_than_half_the_load) {
  const double moment = 16000.0;
  const double springs = 2.0 * moment / (2.0 * 5.12e8);
  EXPECT_NEAR(slack(0.0, moment), springs + 2.0 * 1.0566e-5, 1e-12);
  EXPECT_NEAR(slack(6.9, moment), springs + 2.0 * 1.0566e-5, 1e-12);
  EXPECT_NEAR(slack(7.1, moment), springs, 1e-12);  // 16000 / 2 / 1144 = 6.99 N m
}

// Without the second motor the first has it all: 15990.3 / 1144 = 13.98 N m; its gears wind up by all of it.
TEST(TwoPinions, hold_on_one_when_the_other_is_lost) {
  for (const int lost : {1, 2}) {
    PlantParams<double> p = smooth(true);
    p.lost_motor = lost;
    Sim sim = example::sim(p, servo(20.0));
    sim.static_start(1.5707963267948966, true);
    const double start = sim.x.pos_load;
    EXPECT_NEAR(lost == 1 ? sim.x.torque_motor_2 : sim.x.torque_motor, 15990.3 / 1144.0, 1e-9);
    EXPECT_EQ(lost == 1 ? sim.x.torque_motor : sim.x.torque_motor_2, 0.0);
    EXPECT_NEAR(sim.torque_mesh(), 15990.3, 1e-9);
    run(sim, 0.0, 2000);
    EXPECT_NEAR(lost == 1 ? sim.x.torque_motor_2 : sim.x.torque_motor, 15990.3 / 1144.0, 1e-3);
    EXPECT_EQ(lost == 1 ? sim.x.torque_motor : sim.x.torque_motor_2, 0.0);
    EXPECT_NEAR(sim.torque_mesh(), 15990.3, 1.0);
    EXPECT_NEAR(sim.x.pos_load, start,
                1.2e-5);  // a lost first motor shows nothing of the load within its gap
  }
}

// Cogging of 2 N m turns both motors on. Those with torque hold it; the others do by their friction, of 5.5 N
// m in 5 mrad, or by the brake, of 400 N m in 0.5 mrad, which the first motor has.
TEST(TwoPinions, a_motor_without_torque_is_held_by_friction_or_brake) {
  for (const bool servo_on : {true, false})
    for (const int lost : {0, 1, 2}) {
      PlantParams<double> p = smooth(true);
      p.motor_friction = p.cogging = true;
      p.cogging_torque_nm = 2.0;
      p.cogging_phase_rad = 1.5707963267948966;
      p.eccentric_moment_nm = 0.0;
      p.half_backlash_rad = 0.0;
      p.lost_motor = lost;
      Sim sim = example::sim(p, servo(0.0));
      sim.static_start(0.0, servo_on);
      const double first = servo_on && lost != 1 ? -2.0 : 0.0, second = servo_on && lost != 2 ? -2.0 : 0.0;
      EXPECT_NEAR(sim.x.torque_motor, first, 1e-9);
      EXPECT_NEAR(sim.x.torque_motor_2, second, 1e-9);
      EXPECT_NEAR(sim.x.motor_z, servo_on && lost == 1 ? 2.0 / 1100.0 : 0.0, 1e-12);
      EXPECT_NEAR(sim.x.motor_z_2, second == 0.0 ? 2.0 / 1100.0 : 0.0, 1e-12);
      EXPECT_NEAR(sim.x.brake_z, servo_on ? 0.0 : 2.0 / 8e5, 1e-12);
    }
}

// 385 N m x 1144 = 440.44 kN m is what one motor holds, with or without preload.
TEST(TwoPinions, on_one_motor_hold_up_to_its_torque_limit) {
  for (const double side : {1.0, -1.0})
    for (const double moment : {438e3, 443e3}) {
      PlantParams<double> p = smooth(true);
      p.lost_motor = 2;
      p.eccentric_angle_rad = -1.5707963267948966;
      p.eccentric_moment_nm = -side * moment;
      Sim sim = example::sim(p, servo(20.0));
      sim.static_start(0.0, true);
      run(sim, 0.0, 1000);
      // 2.56 kN m too many turn 2.65e6 kg m2 by 5e-4 rad in 1 s.
      EXPECT_EQ(std::fabs(sim.x.pos_load) > 1e-4, moment > 440440.0) << moment;
      if (moment > 440440.0) {
        EXPECT_TRUE(sim.limited());
        EXPECT_NEAR(sim.x.torque_motor, side * 385.0, 1e-6);
      }
    }
}

// The moment that a motor is lost: its torque is gone with the time constant of its current loop, the other
// has the sum of the loop only as fast as the loop finds it.
TEST(TwoPinions, sag_and_come_back_when_one_is_lost_under_load) {
  PlantParams<double> p = smooth(true);
  Sim sim = example::sim(p, servo(20.0));
  sim.static_start(1.5707963267948966, true);
  run(sim, 0.0, 100);
  const double motor = sim.x.pos_motor;
  p.lost_motor = 2;
  sim.build(p, sim.drive().p, sim.brake_close_cycles(), sim.brake_open_cycles(), sim.timing());
  run(sim, 0.0, 20000);  // the swing of 2 Hz has 2.5 % of damping
  EXPECT_EQ(sim.x.torque_motor_2, 0.0);
  EXPECT_NEAR(sim.x.torque_motor, 15990.3 / 1144.0, 0.05);
  EXPECT_NEAR(sim.x.vel_motor, 0.0, 1e-3);
  EXPECT_NE(sim.x.pos_motor, motor);
}

// 1/2 J w^2 + 1/2 Jm (wm1^2 + wm2^2) + what the springs hold, under no torque: it stays without a damper, and
// falls by what a damper takes.
TEST(TwoPinions, create_no_energy) {
  PlantParams<double> p = smooth(true);
  p.gear_error = true;
  p.eccentric_moment_nm = 0.0;
  p.backlash = false;
  p.half_backlash_rad = 0.0;
  p.current_bandwidth_rad_s = 0.0;
  for (const double damping : {0.0, 1.67e6}) {
    p.damping_nm_s_per_rad = damping;
    Sim sim(p, servo(0.0), 0.0, 0.0, {1e-3, example::kCycle, 8, Scheme::kRungeKutta4, 8});
    sim.static_start(0.3, true);
    sim.x.vel_motor = 40.0;
    sim.x.vel_motor_2 = 30.0;
    sim.x.vel_load = 0.02;
    const auto energy = [&] {
      const PlantState<double>& x = sim.x;
      const auto spring = [&](const GearError<double>& gear, double motor, double place) {
        const double twist = motor / p.ratio + gear.motor_error(motor).error +
                             gear.ring_error(x.pos_load + place).error - x.pos_load;
        return 0.5 * p.stiffness_1_nm_per_rad * twist * twist;
      };
      const Plant<double>& plant = sim.plant();
      return 0.5 * (p.inertia_load_kg_m2 * x.vel_load * x.vel_load +
                    p.inertia_motor_kg_m2 * (x.vel_motor * x.vel_motor + x.vel_motor_2 * x.vel_motor_2)) +
             spring(plant.gear, x.pos_motor, 0.0) +
             spring(plant.second_gear, x.pos_motor_2, p.second_angle_rad);
    };
    const double start = energy();
    double least = start, most = start;
    for (int k = 0; k < 4000; ++k) {
      const double before = energy();
      sim.advance(0.0, example::kCycle);
      if (damping > 0.0) {
        EXPECT_LE(energy(), before + 1e-9 * start);
      }
      least = std::fmin(least, energy());
      most = std::fmax(most, energy());
    }
    // A step of 15.6 us on waves that are continued from an anchor: some 1e-9 of the energy in 0.5 s.
    if (damping == 0.0) {
      EXPECT_LT(most - least, 1e-7 * start);
    }
    if (damping > 0.0) {
      EXPECT_LT(least, 0.99 * start);
    }
  }
}

// A plant with one pinion has none of it: the states of the second stay 0, and its keys say nothing.
TEST(TwoPinions, are_absent_where_they_are_off) {
  PlantParams<double> p = example::plant(), other = p;
  other.second_angle_rad = 1.0;
  other.second_phase_mesh_rad = 1.0;
  other.lost_motor = 1;
  DriveParams<double> d = example::drive(), preloaded = d;
  preloaded.preload_nm = 99.0;
  Sim a = example::sim(p, d), b = example::sim(other, preloaded);
  for (Sim* sim : {&a, &b}) {
    sim->static_start(0.4, true);
    run(*sim, 30.0, 200);
  }
#define X(name, ...) EXPECT_EQ(a.x.name, b.x.name);
  GANTRY_PLANT_STATE(X)
  GANTRY_PLANT_EFFECT_STATE(X)
#undef X
  EXPECT_EQ(a.x.pos_motor_2, 0.0);
  EXPECT_EQ(a.x.torque_motor_2, 0.0);
}

}  // namespace
}  // namespace gantry
