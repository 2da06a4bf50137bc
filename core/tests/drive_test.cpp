// The drive by hand: limits and ramps in both directions, the account of an overload, what an encoder shows.
#include "core/plant/drive.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/plant/encoder_fault.hpp"

namespace gantry {
namespace {

// Gain 2 N m s/rad, integral time 10 ms, 100 N m rated and 150 N m for 4 s, an ideal encoder.
DriveParams<double> simple() {
  DriveParams<double> p;
  p.kvp_nm_s_per_rad = 2.0;
  p.tvi_s = 0.01;
  p.torque_rated_nm = 100.0;
  p.torque_max_nm = 150.0;
  p.overload_time_s = 4.0;
  p.vel_max_rad_s = 130.0;
  p.quick_dec_rad_s2 = 80.0;  // 0.01 rad/s in a cycle
  return p;
}

struct Shaft {
  Drive<double> drive;
  DriveState<double> s;
  bool limited = false;

  explicit Shaft(const DriveParams<double>& p) : drive(p) {}
  double cycle(DriveMode mode, double wanted, double vel, double feed = 0.0) {
    limited = false;
    const double pos = s.pos_last + vel * drive.p.cycle_s;
    const MotorTorques<double> given = drive_cycle(drive, {mode, wanted, feed}, s, pos, vel, limited);
    EXPECT_EQ(given.second, 0.0);  // there is one motor
    return given.first;
  }
};

TEST(Drive, gives_gain_times_error_integral_and_feed_forward) {
  for (double side : {1.0, -1.0}) {
    Shaft shaft(simple());
    EXPECT_NEAR(shaft.cycle(DriveMode::kSpeed, side * 10.0, 0.0, side * 3.0), side * 23.0, 1e-12);
    // The integral has gone on by 10 rad/s x 125 us / 10 ms.
    EXPECT_NEAR(shaft.s.integral, side * 0.125, 1e-12);
    EXPECT_NEAR(shaft.cycle(DriveMode::kSpeed, side * 10.0, side * 10.0), side * 0.25, 1e-9);
    EXPECT_FALSE(shaft.limited);
  }
}

TEST(Drive, limits_torque_and_speed_in_both_directions) {
  for (double side : {1.0, -1.0}) {
    Shaft shaft(simple());
    EXPECT_EQ(shaft.cycle(DriveMode::kSpeed, side * 100.0, 0.0), side * 150.0);
    EXPECT_TRUE(shaft.limited);
    bool earlier = true;  // in the same scan
    drive_cycle(shaft.drive, {DriveMode::kSpeed, 0.0, 0.0}, shaft.s, 0.0, 0.0, earlier);
    EXPECT_TRUE(earlier);
    Shaft fast(simple());
    fast.cycle(DriveMode::kSpeed, side * 1e6, side * 130.0);
    EXPECT_EQ(fast.s.ramp, side * 130.0);
  }
}

TEST(Drive, winds_its_integral_up_no_further_at_the_limit_but_down) {
  for (double side : {1.0, -1.0}) {
    Shaft shaft(simple());
    shaft.s.integral = side * 80.0;
    shaft.cycle(DriveMode::kSpeed, side * 10.0, 0.0);  // 180 N m wanted, more is asked for
    EXPECT_EQ(shaft.s.integral, side * 80.0);
    shaft.cycle(DriveMode::kSpeed, -side * 1.0, 0.0);  // 158 N m wanted, less is asked for
    EXPECT_NEAR(shaft.s.integral, side * (80.0 - 0.0125), 1e-9);
    shaft.s.integral = side * 74.9;
    shaft.cycle(DriveMode::kSpeed, side * 0.5, 0.0);  // 150.8 N m: however little more it is
    EXPECT_EQ(shaft.s.integral, side * 74.9);
  }
}

TEST(Drive, quick_stop_goes_down_its_ramp_in_both_directions_and_ends_at_rest) {
  for (double side : {1.0, -1.0}) {
    Shaft shaft(simple());
    shaft.s.ramp = side * 0.025;
    for (double wanted : {0.015, 0.005, 0.0, 0.0}) {
      shaft.cycle(DriveMode::kQuickStop, side * 50.0, 0.0);
      EXPECT_NEAR(shaft.s.ramp, side * wanted, 1e-12);
    }
  }
}

TEST(Drive, without_power_gives_no_torque_at_once_and_begins_where_the_shaft_is) {
  DriveParams<double> p = simple();
  p.delay_cycles = 1;
  Shaft shaft(p);
  EXPECT_EQ(shaft.cycle(DriveMode::kSpeed, 10.0, 0.0), 0.0);  // acts a cycle later
  EXPECT_NEAR(shaft.s.torque_set, 20.0, 1e-12);
  EXPECT_EQ(shaft.cycle(DriveMode::kOff, 10.0, 3.0), 0.0);
  EXPECT_EQ(shaft.s.torque_set, 0.0);
  EXPECT_EQ(shaft.s.integral, 0.0);
  EXPECT_NEAR(shaft.s.ramp, 3.0, 1e-9);
  EXPECT_FALSE(shaft.limited);
  shaft.cycle(DriveMode::kOff, 1e4, 0.0);  // more than it could give, and nothing is asked for
  EXPECT_FALSE(shaft.limited);
  EXPECT_EQ(DriveCommand<double>().vel_cmd_rad_s, 0.0);
  EXPECT_TRUE(DriveCommand<double>().off);
  EXPECT_FALSE(DriveCommand<double>().quick_stop);
  EXPECT_EQ(DriveCommand<double>().torque_ff_nm, 0.0);
}

// A quarter of the step in the first cycle with a filter of 3/4, then a quarter of what is left.
TEST(Drive, filters_its_speed_feedback) {
  DriveParams<double> p = simple();
  p.speed_filter = 0.75;
  Shaft shaft(p);
  shaft.cycle(DriveMode::kSpeed, 0.0, 8.0);
  EXPECT_NEAR(shaft.s.vel_filtered, 2.0, 1e-9);
  shaft.cycle(DriveMode::kSpeed, 0.0, 8.0);
  EXPECT_NEAR(shaft.s.vel_filtered, 3.5, 1e-9);
}

// One wave per turn, one and two per signal period of a quarter turn; 13 whole turns change nothing.
TEST(Drive, an_encoder_has_errors_of_its_turn_and_of_its_periods) {
  DriveParams<double> p = simple();
  p.encoder_error_1x_rad = 1e-3;
  EXPECT_EQ(encoder_position(p, 0.3, 0.0), 0.3);  // not switched on
  p.encoder_errors = true;
  p.encoder_lines = 4.0;
  const double turns = 13.0 * 6.283185307179586;
  for (double x : {0.3, 0.3 + turns, 0.3 - turns}) {
    p.encoder_eccentricity_rad = 1e-3;
    p.encoder_eccentricity_phase_rad = 0.4;
    p.encoder_error_1x_rad = p.encoder_error_2x_rad = 0.0;
    EXPECT_NEAR(encoder_position(p, x, 0.0) - x, 1e-3 * std::sin(0.7), 1e-13);
    p.encoder_eccentricity_rad = 0.0;
    p.encoder_error_1x_rad = 1e-3;
    EXPECT_NEAR(encoder_position(p, x, 0.0) - x, 1e-3 * std::sin(1.2), 1e-13);
    p.encoder_error_1x_rad = 0.0;
    p.encoder_error_2x_rad = 1e-3;
    EXPECT_NEAR(encoder_position(p, x, 0.0) - x, 1e-3 * std::sin(2.4), 1e-13);
  }
}

// (1.5^2 - 1) s in a second at 150 N m; after 4 s the account of 5 s is full and the limit falls. At half the
// rated torque it falls by 0.75 s in a second.
TEST(Drive, overload_account_fills_falls_and_has_an_end) {
  Shaft shaft(simple());
  EXPECT_NEAR(shaft.drive.budget_s, 5.0, 1e-12);
  const auto second = [&](double torque) {
    double limit = 0.0;
    for (int k = 0; k < 8000; ++k) {
      shaft.s.torque_set = torque;
      limit = torque_limit(shaft.drive, false, shaft.s);
    }
    return limit;
  };
  EXPECT_EQ(second(-150.0), 150.0);
  EXPECT_NEAR(shaft.s.overload, 1.25, 1e-9);
  EXPECT_EQ(second(50.0), 150.0);
  EXPECT_NEAR(shaft.s.overload, 0.5, 1e-9);
  for (int k = 0; k < 5; ++k) second(150.0);
  EXPECT_EQ(shaft.s.overload, 5.0);
  shaft.s.torque_set = 150.0;
  EXPECT_EQ(torque_limit(shaft.drive, false, shaft.s), 100.0);
  EXPECT_EQ(second(100.0 - 1e-9), 150.0);
  for (int k = 0; k < 6; ++k) second(0.0);
  EXPECT_EQ(shaft.s.overload, 0.0);
}

// A drive of less than its rated torque has no more, cold or warm.
TEST(Drive, without_an_overload_gives_what_it_has) {
  DriveParams<double> p = simple();
  p.torque_max_nm = 80.0;
  Shaft shaft(p);
  EXPECT_EQ(torque_limit(shaft.drive, false, shaft.s), 80.0);
  shaft.s.overload = 1e3;
  EXPECT_EQ(torque_limit(shaft.drive, false, shaft.s), 80.0);
}

TEST(Drive, an_encoder_shows_where_the_shaft_was) {
  DriveParams<double> p = simple();
  p.latency_s = 1e-3;
  EXPECT_NEAR(encoder_position(p, 5.0, 2.0), 4.998, 1e-15);
  EXPECT_NEAR(encoder_position(p, 5.0, -2.0), 5.002, 1e-15);
  p.speed_count_rad = 0.5;
  EXPECT_EQ(counted_position(Drive<double>(p), 5.2, 0.0), 5.0);
}

TEST(EncoderFault, goes_on_from_what_it_showed) {
  EncoderFault<double> fault;
  EXPECT_EQ(fault.position(7.0), 7.0);
  EXPECT_EQ(fault.speed(3.0), 3.0);
  EncoderFault<double> jumped;
  jumped.jump(0.5, 7.0);
  EXPECT_EQ(jumped.position(8.0), 8.5);
  EXPECT_EQ(jumped.speed(3.0), 3.0);
  fault.set_gain(0.0, 7.0);  // frozen at 7
  EXPECT_EQ(fault.position(9.0), 7.0);
  EXPECT_EQ(fault.speed(3.0), 0.0);
  fault.set_gain(-1.0, 9.0);  // sign wrong from there
  EXPECT_EQ(fault.position(10.0), 6.0);
  EXPECT_EQ(fault.speed(3.0), -3.0);
  fault.jump(0.5, 10.0);
  EXPECT_EQ(fault.position(10.0), 6.5);
  EXPECT_EQ(fault.position(11.0), 5.5);
  fault.set_gain(1.0, 11.0);  // sound again, at the angle that it has come to
  EXPECT_EQ(fault.position(12.0), 6.5);
}

}  // namespace
}  // namespace gantry
