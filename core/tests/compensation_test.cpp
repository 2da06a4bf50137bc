// The compensations against their closed forms, their limits, and what a wrong or missing number does to
// them.
#include <gtest/gtest.h>

#include <limits>

#include "core/control/compensated_law.hpp"
#include "core/lane/pack.hpp"
#include "core/plant/load_encoder.hpp"
#include "example.hpp"

namespace gantry {
namespace {

using Params = CompensationParams<double>;
using State = CompensationState<double>;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

Moment<double> calibrated(const Params& p) { return {p.moment_sine_nm, p.moment_cosine_nm}; }

Flank<double> flank(const Params& p) { return {p.backlash_rad, p.friction_load_nm}; }

Params maps() {
  Params p;
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

TEST(Harmonics, are_the_sum_of_their_waves) {
  const Params p = maps();
  for (double x : {-3.1, -0.4, 0.0, 1.7}) {
    double value = p.map.mean, slope = 0.0;
    for (int n = 1; n <= 3; ++n) {
      const auto k = static_cast<std::size_t>(n - 1);
      value += p.map.sine[k] * std::sin(n * x) + p.map.cosine[k] * std::cos(n * x);
      slope += n * (p.map.sine[k] * std::cos(n * x) - p.map.cosine[k] * std::sin(n * x));
    }
    EXPECT_NEAR(harmonics(p.map, x).value, value, 1e-18);
    EXPECT_NEAR(harmonics(p.map, x).slope, slope, 1e-18);
  }
}

// The speed of every correction is its change per time: the feed-forward would push the wrong way otherwise.
TEST(Maps, speed_is_the_derivative_of_the_position) {
  Params p = maps();
  p.fade_rad_s = 1e12;  // the fading itself moves with the speed and is left out of the derivative on purpose
  const double pos = 0.7, vel = 0.05, acc = 0.01, jerk = 0.02, h = 1e-5;
  const auto at = [&](double t) {
    return map_correction(p, calibrated(p), flank(p), 0.3 + 2.0 * t, 2.0,
                          pos + t * (vel + t * (acc / 2 + t * jerk / 6)), vel + t * (acc + t * jerk / 2),
                          acc + t * jerk, jerk);
  };
  const double slope = (at(h).pos - at(-h).pos) / (2 * h);
  EXPECT_NEAR(at(0.0).vel, slope, 1e-6 * std::fabs(slope));
}

TEST(Maps, windup_is_torque_over_stiffness) {
  Params p = maps();
  p.gear_map = p.reversal = false;
  const double pos = 1.1, acc = 0.0117;
  const double wanted = (1.6e4 * std::sin(pos) - 2e3 * std::cos(pos)) * 2.8e-9 + 6.2e-3 * acc;
  EXPECT_NEAR(map_correction(p, calibrated(p), flank(p), 0.0, 0.0, pos, 0.0, acc, 0.0).pos, wanted, 1e-16);
}

TEST(Maps, backlash_lies_on_the_flank_that_the_planned_torque_asks_for) {
  Params p;
  p.backlash_rad = 8e-5;
  p.moment_sine_nm = 1.6e4;
  p.friction_load_nm = 6e3;
  p.inertia_load_kg_m2 = 2.2e6;
  p.flank_nm = 1e3;
  const auto at = [&](double direction, double pos, double acc) {
    return backlash_correction(p, calibrated(p), flank(p), direction, 0.0, pos, 0.0, acc, 0.0).pos;
  };
  const double quarter = 1.570796326794896619;
  EXPECT_EQ(at(-1.0, quarter, 0.0), 4e-5);  // the moment holds it, whatever the direction
  EXPECT_EQ(at(1.0, 0.0, 0.0), 4e-5);       // friction alone: pushed
  EXPECT_EQ(at(-1.0, 0.0, 0.0), -4e-5);
  EXPECT_EQ(at(1.0, 0.0, -0.0117), -4e-5);  // braked harder than friction does: on the other flank
  EXPECT_EQ(at(0.0, 0.0, 0.0), 0.0);
}

TEST(Harmonics, above_those_in_use_are_not_looked_at) {
  Params p = maps();
  const double three = harmonics(p.map, 0.7).value;
  p.map.used = 3;
  EXPECT_EQ(harmonics(p.map, 0.7).value, three);
  p.map.used = 2;
  EXPECT_NE(harmonics(p.map, 0.7).value, three);
}

TEST(Maps, are_limited_and_then_stand_still) {
  Params p = maps();
  p.map.sine[0] = 1.0;  // a map of nonsense
  const auto c = map_correction(p, calibrated(p), flank(p), 1.0, 5.0, 1.5, 0.1, 0.0, 0.0);
  EXPECT_EQ(c.pos, p.pos_limit_rad);
  EXPECT_EQ(c.vel, 0.0);
  p.map.sine[0] = -1.0;
  EXPECT_EQ(map_correction(p, calibrated(p), flank(p), 1.0, 5.0, 1.5, 0.1, 0.0, 0.0).pos, -p.pos_limit_rad);
}

TEST(Maps, waves_that_pass_too_fast_are_left_alone) {
  Params p = maps();
  p.fade_rad_s = 50.0;
  Params slow = p;
  slow.fast = {};
  const auto difference = [&](double vel) {
    return std::fabs(gear_correction(p, 0.7, vel).pos - gear_correction(slow, 0.7, vel).pos);
  };
  EXPECT_GT(difference(0.001), 1e-6);
  EXPECT_LT(difference(1.0), 0.01 * difference(0.001));  // 338 waves at 1 rad/s: (338/50)^4 is 2000
}

// A wave of 338 cycles at half a radian per cycle and second: passing twice as fast as fade_rad_s it counts a
// seventeenth, 1 / (1 + 2^4), forwards and backwards.
TEST(Maps, every_wave_in_use_counts_and_fades_alike_both_ways) {
  Params p;
  p.fast[0] = {338.0, 0.0, 4e-6};
  p.fast[1] = {1144.0, 0.0, 1e-6};
  p.fast_used = 2;
  EXPECT_NEAR(gear_correction(p, 0.0, 0.0).pos, 5e-6, 1e-20);
  p.fast_used = 1;
  p.fade_rad_s = 169.0;
  for (double vel : {1.0, -1.0}) EXPECT_NEAR(gear_correction(p, 0.0, vel).pos, 4e-6 / 17.0, 1e-20);
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
  Params p = maps();
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

TEST(LoadSide, integral_goes_towards_the_error_and_is_limited) {
  Params p;
  p.load_encoder = true;
  p.encoder_gain_per_s = 1.0;
  p.encoder_dead_band_rad = 2e-6;
  p.encoder_limit_rad = 1e-4;
  EXPECT_EQ(load_side_bias(p, 0.0, 1.9e-6), 0.0);
  for (double edge : {2e-6, -2e-6}) EXPECT_EQ(load_side_bias(p, 0.0, edge), 0.0);
  EXPECT_NEAR(load_side_bias(p, 0.0, 1e-3), 1e-6, 1e-18);
  EXPECT_EQ(load_side_bias(p, 3e-5, -1.9e-6), 3e-5);
  EXPECT_NEAR(load_side_bias(p, 0.0, -1e-3), -1e-6, 1e-18);
  EXPECT_EQ(load_side_bias(p, 1e-4, 1.0), 1e-4);
  EXPECT_EQ(load_side_bias(p, -1e-4, -1.0), -1e-4);
}

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

TEST(CompensatedLaw, stays_inside_the_command_clamp_whatever_the_damping_says) {
  Params p;
  p.load_encoder = p.damping = true;
  p.damping_gain = 0.05;
  p.swing_rad_s = 12.6;
  State s;
  const PositionLawParams<double> law = example::law();
  compensated_law(law, p, s, {0.0, 0.0, 0.0}, 0.0, 0.0, 0.0);
  EXPECT_EQ(compensated_law(law, p, s, {0.0, 0.0, 0.0}, 0.0, 9.0, 0.0).law.vel_cmd_rad_s, -law.vel_max_rad_s);
  State back;
  compensated_law(law, p, back, {0.0, 0.0, 0.0}, 0.0, 0.0, 0.0);
  EXPECT_EQ(compensated_law(law, p, back, {0.0, 0.0, 0.0}, 0.0, -9.0, 0.0).law.vel_cmd_rad_s,
            law.vel_max_rad_s);
}

// The load runs ahead by 1e-5 rad in a scan of 1 ms, 0.01 rad/s; its twist against the motor is -1e-5 rad.
// The motor yields by 0.05 (10 x 0.01 - 12.6^2 x 1e-5) = 4.92 mrad/s at the gantry, towards a slower motion.
TEST(CompensatedLaw, yields_to_a_load_that_runs_ahead) {
  Params p;
  p.damping = true;
  p.damping_gain = 0.05;
  p.swing_rad_s = 12.6;
  const PositionLawParams<double> law = example::law();
  const double counts = 0.3 * law.ratio / law.rad_per_count;
  for (double side : {1.0, -1.0}) {
    State s;
    const double still = compensated_law(law, p, s, {0.3, 0.0, 0.0}, counts, 0.3, 0.0).law.vel_cmd_rad_s;
    EXPECT_NEAR(still, 0.0, 1e-9);
    const double cmd =
        compensated_law(law, p, s, {0.3, 0.0, 0.0}, counts, 0.3 + side * 1e-5, 0.0).law.vel_cmd_rad_s;
    EXPECT_NEAR(cmd, -side * law.ratio * 0.00492062, 1e-5);
  }
}

// The load at 0.4 rad/s in this scan, 0.2 before, filtered by half: 0.3, at a set-point of 0.1. A twist of
// 1 mrad, a tenth of which counts as resting from now on. 0.5 (10 x 0.2 + 10^2 x 0.9e-3) = 1.045 rad/s.
TEST(CompensatedLaw, yields_to_speed_and_twist_of_a_swing) {
  Params p;
  p.damping_gain = 0.5;
  p.swing_rad_s = 10.0;
  p.damping_filter = 0.5;
  p.damping_slow = 0.1;
  for (double side : {1.0, -1.0}) {
    State s;
    s.ring_last_rad = side * 0.3;
    s.vel_ring_rad_s = side * 0.2;
    EXPECT_NEAR(damping_speed(p, 10.0, s, side * 0.3004, side * 0.1, side * 1e-3), side * 1.045, 1e-9);
    EXPECT_NEAR(s.vel_ring_rad_s, side * 0.3, 1e-9);
    EXPECT_NEAR(s.twist_slow_rad, side * 1e-4, 1e-12);
    s.ring_last_rad = side * 0.3004;  // and stands from now on
    EXPECT_NEAR(damping_speed(p, 10.0, s, side * 0.3004, 0.0, side * 1e-3), side * 0.5 * (1.5 + 0.081), 1e-9);
    EXPECT_NEAR(s.twist_slow_rad, side * 1.9e-4, 1e-12);
  }
}

// Both readings are 1 ms old: at 0.1 rad/s motor and load are 0.1 mrad further on, and agree.
TEST(CompensatedLaw, counts_the_way_since_the_load_side_encoder_was_read) {
  Params p;
  p.load_encoder = true;
  p.latency_s = 1e-3;
  const PositionLawParams<double> law = example::law();
  for (double vel : {0.1, -0.1}) {
    State s;
    const double shown = 0.3 - 1e-3 * vel;
    const double counts = shown * law.ratio / law.rad_per_count;
    const auto out = compensated_law(law, p, s, {0.3, vel, 0.0}, counts, shown, 0.0);
    EXPECT_NEAR(s.ring_last_rad, 0.3, 1e-12);
    EXPECT_NEAR(out.disagreement_rad, 0.0, 1e-9);
  }
}

// A load 1 mrad behind its set-point at a gain of 1 /s: 1 urad in a scan, towards the set-point.
TEST(CompensatedLaw, learns_the_error_of_the_load_in_both_directions) {
  Params p;
  p.load_encoder = true;
  p.encoder_gain_per_s = 1.0;
  p.encoder_limit_rad = 1e-4;
  const PositionLawParams<double> law = example::law();
  for (double side : {1.0, -1.0}) {
    State s;
    const double counts = 0.3 * law.ratio / law.rad_per_count;
    compensated_law(law, p, s, {0.3, 0.0, 0.0}, counts, 0.3 - side * 1e-3, 0.0);
    EXPECT_NEAR(s.bias_rad, side * 1e-6, 1e-15);
  }
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

// Of a twist of 100 urad 44.8 are wound up by the moment (16 kN m x 2.8e-9) and 40 are half the backlash.
TEST(CompensatedLaw, takes_wind_up_and_flank_of_the_plan_off_a_twist) {
  Params p;
  p.moment_sine_nm = 1.6e4;
  p.compliance_rad_per_nm = 2.8e-9;
  p.backlash_rad = 8e-5;
  p.flank_nm = 1e3;
  const double quarter = 1.570796326794896619;
  for (double side : {1.0, -1.0}) {
    const SetPoint<double> r{side * quarter, 0.0, 0.0};
    EXPECT_NEAR(unplanned_twist(p, calibrated(p), flank(p), 0.0, r, side * 1e-4), side * 1.52e-5, 1e-18);
  }
}

// Without a first reading the load is where the motor is.
TEST(CompensatedLaw, begins_where_the_motor_is_when_the_load_side_encoder_shows_nothing) {
  Params p;
  p.load_encoder = true;
  const PositionLawParams<double> law = example::law();
  State s;
  compensated_law(law, p, s, {0.3, 0.0, 0.0}, 0.3 * law.ratio / law.rad_per_count, kNaN, 0.0);
  EXPECT_NEAR(s.ring_last_rad, 0.3, 1e-12);
}

// 20 urad of swing and three missing scans of 50 urad each: 160 urad beside what is reckoned are motion, 180
// a step, of which a hundredth of the swing is taken.
TEST(CompensatedLaw, tells_three_missing_scans_from_a_step) {
  Params p;
  p.load_encoder = true;
  p.swing_speed_max_rad_s = 0.02;
  const PositionLawParams<double> law = example::law();
  for (double vel : {0.05, -0.05})
    for (double side : {1.0, -1.0})
      for (bool step : {false, true}) {
        State s;
        compensated_law(law, p, s, {0.3, vel, 0.0}, 0.3 * law.ratio / law.rad_per_count, 0.3, 0.0);
        const double next = 0.3 + vel * 1e-3;
        const double beside = side * (step ? 1.8e-4 : 1.6e-4);
        const double counts = next * law.ratio / law.rad_per_count;
        compensated_law(law, p, s, {next, vel, 0.0}, counts, next + beside, 0.0);
        EXPECT_NEAR(s.ring_last_rad, next + side * (step ? 2e-7 : 2e-5), 1e-12);
      }
}

// 40 kN m of the 80 over which the flank changes: u = 1/2, u (3 - u^2)/2 = 0.6875 of half the backlash.
// Friction of 6 kN m that turns round at 2 /s is 0.15 of the flank in a second: 1.5 (1 - u^2) x 0.15 of half
// the backlash.
TEST(Maps, cross_the_backlash_smoothly) {
  Params p;
  p.backlash_rad = 8e-5;
  p.moment_sine_nm = 4e4;
  p.friction_load_nm = 6e3;
  p.flank_nm = 8e4;
  const double quarter = 1.570796326794896619;
  for (double side : {1.0, -1.0}) {
    const auto c =
        backlash_correction(p, calibrated(p), flank(p), 0.0, side * 2.0, side * quarter, 0.0, 0.0, 0.0);
    EXPECT_NEAR(c.pos, side * 2.75e-5, 1e-18);
    EXPECT_NEAR(c.vel, side * 6.75e-6, 1e-18);
  }
}

TEST(Maps, a_wave_that_is_not_given_is_none) {
  FastWave<double> no_amplitude, no_cycles;
  no_amplitude.cycles = 2.0;
  no_cycles.sine = 1.0;
  for (const auto& wave : {no_amplitude, no_cycles}) {
    EXPECT_EQ(fast_wave(wave, 0.7).value, 0.0);
    EXPECT_EQ(fast_wave(wave, 0.7).slope, 0.0);
  }
}

// Half of 80 urad, whatever the lost motion adds: the moment lies on the upper flank.
TEST(Maps, take_in_lost_motion_and_backlash) {
  Params p;
  p.reversal = true;
  p.backlash_rad = 8e-5;
  p.moment_sine_nm = 1.6e4;
  p.flank_nm = 1e3;
  p.pos_limit_rad = 1e-3;
  p.lost_motion.mean = 1e-5;
  const double quarter = 1.570796326794896619;
  for (double side : {1.0, -1.0}) {
    const auto c = map_correction(p, calibrated(p), flank(p), side, 0.0, quarter, 0.0, 0.0, 0.0);
    EXPECT_NEAR(c.pos, 4e-5 + side * 1e-5, 1e-18);
    // A direction that turns round at 3 /s takes the lost motion with it.
    EXPECT_NEAR(map_correction(p, calibrated(p), flank(p), side, 3.0, quarter, 0.0, 0.0, 0.0).vel, 3e-5,
                1e-18);
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

TEST(CompensatedLaw, finds_a_sound_load_where_motor_and_maps_say) {
  Params p = maps();
  p.load_encoder = true;
  const PositionLawParams<double> law = example::law();
  State s;
  s.direction = 1.0;
  const double counts = 0.9 * law.ratio / law.rad_per_count;
  const double load = resting_position(law, p, s, counts);
  EXPECT_GT(std::fabs(load - 0.9), 1e-5);
  const auto out = compensated_law(law, p, s, {load, 0.0, 0.0}, counts, load, 0.0);
  EXPECT_NEAR(out.disagreement_rad, 0.0, 1e-8);
  // 20 urad further on the load is ahead.
  EXPECT_NEAR(compensated_law(law, p, s, {load, 0.0, 0.0}, counts, load + 2e-5, 0.0).disagreement_rad, 2e-5,
              1e-8);
}

// The scale of the load-side encoder is 4 urad long at 0.3 rad: where it shows 0.300004 the load is at 0.3.
TEST(CompensatedLaw, takes_the_errors_of_the_scale_off_the_reading) {
  Params p;
  p.load_encoder = p.scale_map = true;
  p.scale.mean = 4e-6;
  const PositionLawParams<double> law = example::law();
  State s;
  const double counts = 0.3 * law.ratio / law.rad_per_count;
  const auto out = compensated_law(law, p, s, {0.3, 0.0, 0.0}, counts, 0.300004, 0.0);
  EXPECT_NEAR(s.ring_last_rad, 0.3, 1e-12);
  EXPECT_NEAR(out.disagreement_rad, 0.0, 1e-9);
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
  begin_following(p, Moment<Two>{Two(0.0), Two(0.0)}, Flank<Two>{Two(0.0), Two(0.0)}, Two(1144.0),
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

// 2e-5 rad of swing in a scan are allowed; backwards at 0.05 rad/s 1e-5 beside the set-point are no step.
TEST(CompensatedLaw, takes_a_swing_as_it_is_forwards_and_backwards) {
  Params p;
  p.load_encoder = true;
  p.swing_speed_max_rad_s = 0.02;
  const PositionLawParams<double> law = example::law();
  for (double vel : {0.05, -0.05}) {
    State s;
    const auto scan = [&](double pos, double ring) {
      compensated_law(law, p, s, {pos, vel, 0.0}, pos * law.ratio / law.rad_per_count, ring, 0.0);
      return s.ring_last_rad;
    };
    EXPECT_EQ(scan(0.3, 0.3), 0.3);
    const double next = 0.3 + vel * 1e-3;
    EXPECT_EQ(scan(next, next + 1e-5), next + 1e-5);
  }
}

// An acceleration winds the transmission up as planned: the motor must not yield to it, or the load would
// lag.
TEST(CompensatedLaw, yields_to_no_wind_up_that_is_planned) {
  Params p;
  p.damping = true;
  p.damping_gain = 0.05;
  p.swing_rad_s = 12.6;
  p.damping_slow = 1e-3;
  p.moment_sine_nm = 1.6e4;
  p.compliance_rad_per_nm = 2.8e-9;
  p.windup_per_acc_s2 = 6.2e-3;
  Params stiff = p;
  stiff.damping = false;
  const PositionLawParams<double> law = example::law();
  State s, without;
  const double jerk = 0.02;
  for (double t = 0.0; t < 0.5; t += p.period_s) {
    const SetPoint<double> r{0.3 + jerk * t * t * t / 6, jerk * t * t / 2, jerk * t};
    const double windup = windup_correction(p, calibrated(p), r.pos, r.vel, r.acc, jerk).pos;
    const double counts = (r.pos + windup) * law.ratio / law.rad_per_count;
    const double apart = compensated_law(law, p, s, r, counts, r.pos, 0.0).law.vel_cmd_rad_s -
                         compensated_law(law, stiff, without, r, counts, r.pos, 0.0).law.vel_cmd_rad_s;
    // Kpp x gain x half a scan of the acceleration; the wind-up taken for a swing would be 5e-4 rad/s in the
    // end.
    EXPECT_NEAR(apart / law.ratio, 0.0, 4e-6);
  }
}

TEST(CompensatedLaw, lets_a_motor_side_that_is_no_number_through_to_the_guard) {
  State s;
  EXPECT_TRUE(std::isnan(
      compensated_law(example::law(), maps(), s, {0.0, 0.0, 0.0}, kNaN, 0.0, 0.0).law.vel_cmd_rad_s));
}

TEST(CompensatedLaw, reckons_on_without_a_load_side_reading_and_says_so) {
  Params p = maps();
  p.load_encoder = p.damping = true;
  p.encoder_gain_per_s = 1.0;
  p.encoder_limit_rad = 1e-4;
  p.damping_gain = 0.05;
  p.swing_rad_s = 12.6;
  const PositionLawParams<double> law = example::law();
  constexpr double kInf = std::numeric_limits<double>::infinity();
  for (double lost : {kNaN, kInf, -kInf, 1e300, -1e300, 12.0, -12.0, 10.0, -10.0}) {  // no angles of a gantry
    State s;
    compensated_law(law, p, s, {0.3, 0.01, 0.0}, 0.3 * law.ratio / law.rad_per_count, 0.3, 0.0);
    const auto out =
        compensated_law(law, p, s, {0.30001, 0.01, 0.0}, 0.30001 * law.ratio / law.rad_per_count, lost, 0.0);
    EXPECT_TRUE(std::isfinite(out.law.vel_cmd_rad_s));
    EXPECT_NEAR(s.ring_last_rad, 0.30001, 1e-9);
    EXPECT_FALSE(std::fabs(out.disagreement_rad) < 1.0);
  }
}

TEST(CompensatedLaw, takes_a_step_of_the_load_side_encoder_slowly_and_tells_it_whole) {
  Params p;
  p.load_encoder = true;
  p.swing_speed_max_rad_s = 0.02;
  const PositionLawParams<double> law = example::law();
  for (double step : {1e-3, -1e-3}) {
    State s;
    compensated_law(law, p, s, {0.3, 0.01, 0.0}, 0.3 * law.ratio / law.rad_per_count, 0.3, 0.0);
    const auto out = compensated_law(law, p, s, {0.30001, 0.01, 0.0}, 0.30001 * law.ratio / law.rad_per_count,
                                     0.30001 + step, 0.0);
    EXPECT_NEAR(s.ring_last_rad, 0.30001 + std::copysign(0.0002 * p.period_s, step), 1e-12);
    EXPECT_NEAR(out.disagreement_rad, step, 1e-9);  // half a step of the motor encoder
    // Within the swing it is taken as it is, to the bit.
    const double next = s.ring_last_rad + 1e-5;
    compensated_law(law, p, s, {0.30002, 0.01, 0.0}, 0.30002 * law.ratio / law.rad_per_count, next, 0.0);
    EXPECT_EQ(s.ring_last_rad, next);
  }
}

TEST(CompensatedLaw, starts_without_a_jump_at_the_resting_position) {
  const Params p = maps();
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

// The same source over a pack gives every lane the bits of one axis alone.
TEST(CompensatedLaw, in_a_pack_is_that_of_each_lane) {
  constexpr int kLanes = 4;
  const PositionLawParams<double> law = example::law();
  const PositionLawParams<Pack<kLanes>> laws{law.kpp_per_s, law.kvf, law.ratio, law.rad_per_count,
                                             law.vel_max_rad_s};
  Params one = maps();
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

TEST(LoadEncoder, noise_has_mean_0_and_variance_1) {
  double sum = 0.0, squares = 0.0;
  constexpr int kReadings = 100000;
  for (std::uint64_t n = 0; n < kReadings; ++n) {
    const double x = reading_noise(n);
    sum += x;
    squares += x * x;
  }
  // three standard errors of mean and variance
  EXPECT_NEAR(sum / kReadings, 0.0, 0.0095);
  EXPECT_NEAR(squares / kReadings, 1.0, 0.0135);
}

// The sums of the four parts of the hash, computed elsewhere, less their mean of 131070, over 37837.
TEST(LoadEncoder, noise_of_a_reading_is_the_same_on_every_machine) {
  EXPECT_NEAR(reading_noise(0), 15635.0 / 37837.0, 1e-12);
  EXPECT_NEAR(reading_noise(1), -74702.0 / 37837.0, 1e-12);
  EXPECT_NEAR(reading_noise(2), -60671.0 / 37837.0, 1e-12);
  EXPECT_NEAR(reading_noise(1000), 56558.0 / 37837.0, 1e-12);
  LoadEncoderParams<double> p;
  p.noise_rad = 1e-6;
  EXPECT_NEAR(load_encoder_reading(p, 0.5, 0.0, 1.0), 0.5 - 1e-6 * 74702.0 / 37837.0, 1e-15);
  p.noise_rad = 0.0;
  p.step_rad = 1e-6;
  EXPECT_NEAR(load_encoder_reading(p, 0.50000042, 0.0, 1.0), 0.5, 1e-12);
  EXPECT_NEAR(load_encoder_reading(p, -0.50000062, 0.0, 1.0), -0.500001, 1e-12);
}

TEST(LoadEncoder, reads_steps_of_an_older_angle_with_its_own_errors) {
  LoadEncoderParams<double> p;
  p.fitted = true;
  p.step_rad = 1e-6;
  p.latency_s = 1e-3;
  EXPECT_NEAR(load_encoder_reading(p, 0.5, 0.1, 7.0), 0.4999, 0.5e-6);
  p.step_rad = 0.0;
  p.scale[0] = {2.0, 4e-6, 1.0};
  EXPECT_NEAR(load_encoder_reading(p, 0.0, 0.0, 7.0), 0.0, 1e-18);
  EXPECT_NEAR(load_encoder_reading(p, 0.5, 0.0, 7.0), 0.5 + 4e-6 * (std::sin(2.0) - std::sin(1.0)), 1e-15);
}

}  // namespace
}  // namespace gantry
