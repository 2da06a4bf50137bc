// What the law makes of a load-side encoder: the error that it learns, steps, and readings that are missing
// or wrong.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/control/compensated_law.hpp"
#include "example.hpp"

namespace gantry {
namespace {

using Params = CompensationParams<double>;
using State = CompensationState<double>;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

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

TEST(CompensatedLaw, finds_a_sound_load_where_motor_and_maps_say) {
  Params p = example::maps();
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
  p.latency_s = 1e-3;
  const PositionLawParams<double> law = example::law();
  for (double vel : {0.0, 0.1, -0.1}) {
    State s;
    const double shown = 0.3 - 1e-3 * vel;  // by both encoders, a millisecond ago
    const double counts = shown * law.ratio / law.rad_per_count;
    const auto out = compensated_law(law, p, s, {0.3, vel, 0.0}, counts, shown + 4e-6, 0.0);
    EXPECT_NEAR(s.ring_last_rad, 0.3, 1e-12);
    EXPECT_NEAR(out.disagreement_rad, 0.0, 1e-9);
  }
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

// Without a first reading the load is where the motor is.
TEST(CompensatedLaw, begins_where_the_motor_is_when_the_load_side_encoder_shows_nothing) {
  Params p;
  p.load_encoder = true;
  const PositionLawParams<double> law = example::law();
  State s;
  compensated_law(law, p, s, {0.3, 0.0, 0.0}, 0.3 * law.ratio / law.rad_per_count, kNaN, 0.0);
  EXPECT_NEAR(s.ring_last_rad, 0.3, 1e-12);
}

TEST(CompensatedLaw, reckons_on_without_a_load_side_reading_and_says_so) {
  Params p = example::maps();
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

}  // namespace
}  // namespace gantry
