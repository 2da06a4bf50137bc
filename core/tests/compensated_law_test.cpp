// The law of the motor side with its corrections, and its torque ahead: scan by scan against figures computed
// by hand.
#include "core/control/compensated_law.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <limits>

#include "core/lane/pack.hpp"
#include "example.hpp"

namespace gantry {
namespace {

using Params = CompensationParams<double>;
using State = CompensationState<double>;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

TEST(CompensatedLaw, with_everything_off_is_the_position_law) {
  const PositionLawParams<double> law = example::law();
  const Params p;
  State s;
  for (double counts : {0.0, 1e6, -3e7}) {
    const auto bare = position_law(law, 0.3, 0.01, counts);
    const auto with = compensated_law(law, p, s, {0.3, 0.01, 0.002}, counts, kNaN, 0.0);
    EXPECT_EQ(with.law.vel_cmd_rad_s, bare.vel_cmd_rad_s);
    EXPECT_EQ(with.law.pos_act_rad, bare.pos_act_rad);
    EXPECT_EQ(with.law.pos_err_rad, bare.pos_err_rad);
    EXPECT_EQ(with.torque_ff_nm, 0.0);
  }
}

TEST(CompensatedLaw, starts_without_a_jump_at_the_resting_position) {
  const Params p = example::maps();
  const PositionLawParams<double> law = example::law();
  State s;
  s.direction = 1.0;
  const double counts = 0.9 * law.ratio / law.rad_per_count;
  const double rest = resting_position(law, p, s, counts);
  const auto first = compensated_law(law, p, s, {rest, 0.0, 0.0}, counts, 0.0, 0.0);
  // third order of a map of 1e-4 rad with slopes of 4e-3; 5e-9 rad are a sixtieth of an encoder step
  EXPECT_NEAR(first.law.pos_err_rad, 0.0, 5e-9);
  EXPECT_NEAR(first.law.pos_act_rad, rest, 5e-9);
}

// Of two axes in a pack one follows already: it keeps what it has, the other begins at its set-point.
TEST(CompensatedLaw, begins_in_the_lanes_that_do_not_follow_yet) {
  using Two = Pack<2>;
  CompensationParams<Two> p;
  CompensationState<Two> s;
  s.started.lane[0] = true;
  s.pos_last_rad = Two(0.1);
  s.acc_last_rad_s2 = Two(0.2);
  s.ring_last_rad = Two(0.3);
  s.vel_ring_rad_s = Two(0.4);
  s.twist_slow_rad = Two(0.5);
  s.torque_zero_nm = Two(0.6);
  begin_following(p, Moment<Two>{Two(0.0), Two(0.0)}, Flank<Two>{Two(0.0), Two(0.0), Two(0.0)}, Two(1144.0),
                  SetPoint<Two>{Two(1.0), Two(2.0), Two(3.0)}, Two(1.5), Two(1.25), s);
  const auto expect = [](const Two& found, double kept, double fresh) {
    EXPECT_EQ(found.lane[0], kept);
    EXPECT_EQ(found.lane[1], fresh);
  };
  expect(s.pos_last_rad, 0.1, 1.0);
  expect(s.acc_last_rad_s2, 0.2, 3.0);
  expect(s.ring_last_rad, 0.3, 1.25);
  expect(s.vel_ring_rad_s, 0.4, 2.0);
  expect(s.twist_slow_rad, 0.5, 0.25);
  expect(s.torque_zero_nm, 0.6, 0.0);
  EXPECT_TRUE(s.started.lane[0] && s.started.lane[1]);
}

// Readings are 1 ms old: at 0.1 rad/s the motor is 0.1 mrad further on. On its set-point it gets the speed
// fed forward and nothing more, and the angle shown is where it is.
TEST(CompensatedLaw, counts_the_way_since_the_encoder_was_read) {
  Params p;
  p.latency_s = 1e-3;
  const PositionLawParams<double> law = example::law();
  for (double vel : {0.1, -0.1}) {
    State s;
    const double counts = (0.3 - 1e-3 * vel) * law.ratio / law.rad_per_count;
    const auto out = compensated_law(law, p, s, {0.3, vel, 0.0}, counts, 0.0, 0.0);
    EXPECT_NEAR(out.law.vel_cmd_rad_s, law.ratio * vel, 1e-8);
    EXPECT_NEAR(out.law.pos_act_rad, 0.3, 1e-12);
  }
}

// A correction is what the motor leads the load by: 1e-5 rad of it are 10 /s x 1144 x 1e-5 of speed, and the
// load is that much behind the motor.
TEST(CompensatedLaw, leads_the_load_by_its_correction) {
  const Params p;
  const PositionLawParams<double> law = example::law();
  State s;
  s.bias_rad = 1e-5;
  const double counts = 0.3 * law.ratio / law.rad_per_count;
  EXPECT_NEAR(resting_position(law, p, s, counts), 0.3 - 1e-5, 1e-12);
  const auto out = compensated_law(law, p, s, {0.3, 0.0, 0.0}, counts, 0.0, 0.0);
  EXPECT_NEAR(out.law.vel_cmd_rad_s, 0.1144, 1e-7);
  EXPECT_NEAR(out.law.pos_act_rad, 0.3 - 1e-5, 1e-12);
}

// A map of 1 mrad sin x at 0: nothing to lead by, but 1 mrad more a radian. The motor is commanded that much
// faster, through kvf = 1.
TEST(CompensatedLaw, feeds_the_speed_of_its_correction_forward) {
  Params p;
  p.gear_map = true;
  p.map.sine[0] = 1e-3;
  p.pos_limit_rad = 1e-2;
  const PositionLawParams<double> law = example::law();
  for (double vel : {0.1, -0.1}) {
    State s;
    const auto out = compensated_law(law, p, s, {0.0, vel, 0.0}, 0.0, 0.0, 0.0);
    EXPECT_NEAR(out.law.vel_cmd_rad_s, law.ratio * 1.001 * vel, 1e-9);
  }
}

TEST(CompensatedLaw, turns_its_direction_round_over_the_reversal_length) {
  Params p;
  p.reversal_length_rad = 1e-4;
  const PositionLawParams<double> law = example::law();
  State s;
  const auto to = [&](double pos) {
    compensated_law(law, p, s, {pos, 0.0, 0.0}, 0.0, 0.0, 0.0);
    return s.direction;
  };
  EXPECT_EQ(to(0.0), 0.0);
  EXPECT_NEAR(to(5e-5), 0.5, 1e-12);
  EXPECT_EQ(to(1.0), 1.0);
  EXPECT_NEAR(to(1.0 - 5e-5), 0.5, 1e-10);
  EXPECT_EQ(to(-1.0), -1.0);
  EXPECT_NEAR(to(-1.0 + 5e-5), -0.5, 1e-10);
}

// From -1 half way to 0 in a scan of 1 ms: a lost motion of 1 urad turns round by 500 /s of it.
TEST(CompensatedLaw, leads_a_reversal_by_its_speed) {
  Params p;
  p.reversal = true;
  p.reversal_length_rad = 1e-4;
  p.lost_motion.mean = 1e-6;
  p.pos_limit_rad = 1.0;
  PositionLawParams<double> law = example::law();
  law.kpp_per_s = 0.0;
  State s;
  s.started = true;
  s.direction = -1.0;
  const auto out = compensated_law(law, p, s, {5e-5, 0.0, 0.0}, 0.0, 0.0, 0.0);
  EXPECT_NEAR(out.law.vel_cmd_rad_s, law.ratio * 5e-4, 1e-9);
}

// A direction that goes from 0 to the half in a scan of 1 ms turns at 500 /s: 10 urad of lost motion then
// pass at 5 mrad/s. An acceleration that grows by 2 mrad/s2 in a scan, 2 rad/s3, winds up at 6.2e-3 x 2
// rad/s, and one that stays not at all.
TEST(CompensatedLaw, takes_turning_and_jerk_from_one_scan_to_the_next) {
  const PositionLawParams<double> law = example::law();
  for (double side : {1.0, -1.0}) {
    Params p;
    p.reversal = true;
    p.reversal_length_rad = 1e-4;
    p.lost_motion.mean = 1e-5;
    p.pos_limit_rad = 1e-3;
    State s;
    compensated_law(law, p, s, {0.3, 0.0, 0.0}, 0.3 * law.ratio / law.rad_per_count, 0.0, 0.0);
    const double next = 0.3 + side * 5e-5;
    const double led = (next + side * 5e-6) * law.ratio / law.rad_per_count;
    const auto out = compensated_law(law, p, s, {next, 0.0, 0.0}, led, 0.0, 0.0);
    EXPECT_NEAR(out.law.vel_cmd_rad_s, side * law.ratio * 5e-3, 1e-7);

    p = Params();
    p.windup = true;
    p.windup_per_acc_s2 = 6.2e-3;
    p.pos_limit_rad = 1e-2;
    State t;
    const auto speed = [&](double acc) {
      const double counts = (0.3 + 6.2e-3 * acc) * law.ratio / law.rad_per_count;
      return compensated_law(law, p, t, {0.3, 0.0, acc}, counts, 0.0, 0.0).law.vel_cmd_rad_s;
    };
    EXPECT_NEAR(speed(side * 0.1), 0.0, 1e-7);
    EXPECT_NEAR(speed(side * 0.102), side * law.ratio * 1.24e-2, 1e-7);
    EXPECT_NEAR(speed(side * 0.102), 0.0, 1e-7);
  }
}

// A jerk of 2 rad/s3 where 1 is the most that moves have: wound up at 6.2e-3 x 1 rad/s, both ways, and the
// observer hears nothing for the 2 ms in which the load swings out; with a jerk of moves it does.
TEST(CompensatedLaw, follows_no_jerk_beyond_that_of_moves_and_learns_nothing_while_it_swings_out) {
  const PositionLawParams<double> law = example::law();
  for (double side : {1.0, -1.0}) {
    Params p;
    p.windup = true;
    p.windup_per_acc_s2 = 6.2e-3;
    p.pos_limit_rad = 1e-2;
    p.jerk_max_rad_s3 = 1.0;
    p.observer_calm_s = 2e-3;
    State s;
    const auto speed = [&](double acc) {
      const double counts = (0.3 + 6.2e-3 * acc) * law.ratio / law.rad_per_count;
      return compensated_law(law, p, s, {0.3, 0.0, acc}, counts, 0.0, 0.0).law.vel_cmd_rad_s;
    };
    EXPECT_NEAR(speed(0.0), 0.0, 1e-7);
    EXPECT_NEAR(speed(side * 0.0005), side * law.ratio * 6.2e-3 * 0.5, 1e-7);
    EXPECT_EQ(s.swings_s, 0.0);
    EXPECT_NEAR(speed(side * 0.0025), side * law.ratio * 6.2e-3, 1e-7);
    EXPECT_EQ(s.swings_s, 2e-3);
    EXPECT_NEAR(speed(side * 0.0025), 0.0, 1e-7);
    EXPECT_NEAR(s.swings_s, 1e-3, 1e-12);
    speed(side * 0.0025);
    EXPECT_NEAR(s.swings_s, 0.0, 1e-12);
  }
}

// An acceleration that grows by 2 rad/s^3 winds up by 2 mrad/s, by 10 rad/s^3 no faster than the 5 of moves:
// then the load swings for a second, whatever a scan lasts.
TEST(CompensatedLaw, takes_jerk_and_swing_by_the_time_and_not_by_scans) {
  for (double period : {1e-3, 1e-2}) {
    Params p;
    p.windup = true;
    p.period_s = period;
    p.windup_per_acc_s2 = 1e-3;
    p.pos_limit_rad = 1.0;
    p.jerk_max_rad_s3 = 5.0;
    p.observer_calm_s = 1.0;
    const PositionLawParams<double> law{0.0, 1.0, 100.0, 1.0, 1e3};  // the speed is fed forward alone
    State s;
    const auto command = [&](double acc) {
      return compensated_law(law, p, s, {0.0, 0.0, acc}, 0.0, 0.0, 0.0).law.vel_cmd_rad_s;
    };
    EXPECT_NEAR(command(0.0), 0.0, 1e-12);
    EXPECT_NEAR(command(2.0 * period), 100.0 * 2e-3, 1e-9);
    EXPECT_EQ(s.swings_s, 0.0);
    EXPECT_NEAR(command(12.0 * period), 100.0 * 5e-3, 1e-9);
    EXPECT_EQ(s.swings_s, 1.0);
    EXPECT_NEAR(command(12.0 * period), 0.0, 1e-9);
    EXPECT_NEAR(s.swings_s, 1.0 - period, 1e-12);
  }
}

// 16 kN m at a quarter turn are 13.986 N m of the motor through 1144.
TEST(TorqueFeedForward, carries_the_eccentric_moment_through_the_ratio) {
  Params p;
  p.torque_eccentric = true;
  p.moment_sine_nm = 1.6e4;
  p.torque_limit_nm = 20.0;
  const PositionLawParams<double> law = example::law();
  const double quarter = 1.570796326794896619;
  for (double side : {1.0, -1.0}) {
    State s;
    compensated_law(law, p, s, {0.0, 0.0, 0.0}, 0.0, 0.0, 0.0);
    const auto out = compensated_law(law, p, s, {side * quarter, 0.0, 0.0}, 0.0, 0.0, 0.0);
    EXPECT_NEAR(out.torque_ff_nm, side * 13.986, 1e-3);
  }
}

TEST(TorqueFeedForward, is_clamped_and_zero_where_the_axis_began) {
  Params p = example::maps();
  p.torque_eccentric = p.torque_acceleration = true;
  p.inertia_kg_m2 = 2.65e6;
  p.torque_limit_nm = 20.0;
  State s;
  const PositionLawParams<double> law = example::law();
  EXPECT_EQ(compensated_law(law, p, s, {1.0, 0.0, 0.0}, 0.0, 0.0, 0.0).torque_ff_nm, 0.0);
  const double up = compensated_law(law, p, s, {1.0, 0.0, 0.004}, 0.0, 0.0, 0.0).torque_ff_nm;
  EXPECT_NEAR(up, 2.65e6 * 0.004 / law.ratio, 1e-9);
  EXPECT_EQ(compensated_law(law, p, s, {1.0, 0.0, 1.0}, 0.0, 0.0, 0.0).torque_ff_nm, 20.0);
  EXPECT_EQ(compensated_law(law, p, s, {1.0, 0.0, -1.0}, 0.0, 0.0, 0.0).torque_ff_nm, -20.0);
}

// The motor angle that the backlash observer works with is less the error of the gears.
TEST(CompensatedLaw, shows_the_backlash_observer_the_motor_without_its_gear_error) {
  Params p;
  p.gear_map = true;
  p.map.mean = 1e-3;
  p.pos_limit_rad = 1.0;
  const PositionLawParams<double> law = example::law();
  for (bool observed : {true, false}) {
    p.backlash_observer = observed;
    State s;
    compensated_law(law, p, s, {0.3, 0.0, 0.0}, 0.3 * law.ratio / law.rad_per_count, 0.0, 0.0);
    EXPECT_NEAR(s.motor_last_rad, observed ? 0.299 : 0.0, 1e-12);
  }
}

TEST(CompensatedLaw, lets_a_motor_side_that_is_no_number_through_to_the_guard) {
  State s;
  EXPECT_TRUE(std::isnan(compensated_law(example::law(), example::maps(), s, {0.0, 0.0, 0.0}, kNaN, 0.0, 0.0)
                             .law.vel_cmd_rad_s));
}

// The same source over a pack gives every lane the bits of one axis alone.
TEST(CompensatedLaw, in_a_pack_is_that_of_each_lane) {
  constexpr int kLanes = 4;
  const PositionLawParams<double> law = example::law();
  const PositionLawParams<Pack<kLanes>> laws{law.kpp_per_s, law.kvf, law.ratio, law.rad_per_count,
                                             law.vel_max_rad_s};
  Params one = example::maps();
  one.load_encoder = one.damping = true;
  one.lost_motion = {};
  one.fast = {};
  CompensationParams<Pack<kLanes>> many = example::in_every_lane<kLanes>(one);
  for (std::size_t k = 0; k < one.map.sine.size(); ++k) {
    many.map.sine[k] = one.map.sine[k];
    many.map.cosine[k] = one.map.cosine[k];
  }
  many.map.mean = one.map.mean;
  CompensationState<Pack<kLanes>> states;
  State state[kLanes];
  for (int scan = 0; scan < 3; ++scan) {
    const SetPoint<double> r{0.4 + 1e-5 * scan, 0.01, 0.002};
    const SetPoint<Pack<kLanes>> points{r.pos, r.vel, r.acc};
    Pack<kLanes> counts, ring;
    for (int k = 0; k < kLanes; ++k) {
      counts.lane[k] = (0.4 + 1e-4 * k) * law.ratio / law.rad_per_count;
      ring.lane[k] = 0.4 - 1e-4 * k;
    }
    const auto pack = compensated_law(laws, many, states, points, counts, ring, Pack<kLanes>(0.0));
    for (int k = 0; k < kLanes; ++k) {
      const auto lane = compensated_law(law, one, state[k], r, counts.lane[k], ring.lane[k], 0.0);
      EXPECT_EQ(pack.law.vel_cmd_rad_s.lane[k], lane.law.vel_cmd_rad_s);
      EXPECT_EQ(pack.disagreement_rad.lane[k], lane.disagreement_rad);
    }
  }
}

}  // namespace
}  // namespace gantry
