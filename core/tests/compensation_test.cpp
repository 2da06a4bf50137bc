// The corrections of the maps against their closed forms, and their limits.
#include "core/control/compensation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>

#include "example.hpp"

namespace gantry {
namespace {

using Params = CompensationParams<double>;

TEST(Harmonics, are_the_sum_of_their_waves) {
  const Params p = example::maps();
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

TEST(Harmonics, above_those_in_use_are_not_looked_at) {
  Params p = example::maps();
  const double three = harmonics(p.map, 0.7).value;
  p.map.used = 3;
  EXPECT_EQ(harmonics(p.map, 0.7).value, three);
  p.map.used = 2;
  EXPECT_NE(harmonics(p.map, 0.7).value, three);
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

// The speed of every correction is its change per time: the feed-forward would push the wrong way otherwise.
TEST(Maps, speed_is_the_derivative_of_the_position) {
  Params p = example::maps();
  p.fade_rad_s = 1e12;  // the fading itself moves with the speed and is left out of the derivative on purpose
  const double pos = 0.7, vel = 0.05, acc = 0.01, jerk = 0.02, h = 1e-5;
  const auto at = [&](double t) {
    return map_correction(p, example::calibrated(p), example::flank(p), 0.3 + 2.0 * t, 2.0,
                          pos + t * (vel + t * (acc / 2 + t * jerk / 6)), vel + t * (acc + t * jerk / 2),
                          acc + t * jerk, jerk);
  };
  const double slope = (at(h).pos - at(-h).pos) / (2 * h);
  EXPECT_NEAR(at(0.0).vel, slope, 1e-6 * std::fabs(slope));
}

TEST(Maps, windup_is_torque_over_stiffness) {
  Params p = example::maps();
  p.gear_map = p.reversal = false;
  const double pos = 1.1, acc = 0.0117;
  const double wanted = (1.6e4 * std::sin(pos) - 2e3 * std::cos(pos)) * 2.8e-9 + 6.2e-3 * acc;
  EXPECT_NEAR(map_correction(p, example::calibrated(p), example::flank(p), 0.0, 0.0, pos, 0.0, acc, 0.0).pos,
              wanted, 1e-16);
}

TEST(Maps, backlash_lies_on_the_flank_that_the_planned_torque_asks_for) {
  Params p;
  p.backlash_rad = 8e-5;
  p.moment_sine_nm = 1.6e4;
  p.friction_load_nm = 6e3;
  p.inertia_load_kg_m2 = 2.2e6;
  p.flank_nm = 1e3;
  const auto at = [&](double direction, double pos, double acc) {
    return backlash_correction(p, example::calibrated(p), example::flank(p), direction, 0.0, pos, 0.0, acc,
                               0.0)
        .pos;
  };
  const double quarter = 1.570796326794896619;
  EXPECT_EQ(at(-1.0, quarter, 0.0), 4e-5);  // the moment holds it, whatever the direction
  EXPECT_EQ(at(1.0, 0.0, 0.0), 4e-5);       // friction alone: pushed
  EXPECT_EQ(at(-1.0, 0.0, 0.0), -4e-5);
  EXPECT_EQ(at(1.0, 0.0, -0.0117), -4e-5);  // braked harder than friction does: on the other flank
  EXPECT_EQ(at(0.0, 0.0, 0.0), 0.0);
}

TEST(Maps, are_limited_and_then_stand_still) {
  Params p = example::maps();
  p.map.sine[0] = 1.0;  // a map of nonsense
  const auto c = map_correction(p, example::calibrated(p), example::flank(p), 1.0, 5.0, 1.5, 0.1, 0.0, 0.0);
  EXPECT_EQ(c.pos, p.pos_limit_rad);
  EXPECT_EQ(c.vel, 0.0);
  p.map.sine[0] = -1.0;
  EXPECT_EQ(map_correction(p, example::calibrated(p), example::flank(p), 1.0, 5.0, 1.5, 0.1, 0.0, 0.0).pos,
            -p.pos_limit_rad);
}

TEST(Maps, waves_that_pass_too_fast_are_left_alone) {
  Params p = example::maps();
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
// seventeenth, 1 / (1 + 2^4), forwards and backwards, and so does its speed: 338 x 2 um/17 in a second.
TEST(Maps, every_wave_in_use_counts_and_fades_alike_both_ways) {
  Params p;
  p.fast[0] = {338.0, 2e-6, 4e-6};
  p.fast[1] = {1144.0, 0.0, 1e-6};
  p.fast_used = 2;
  EXPECT_NEAR(gear_correction(p, 0.0, 0.0).pos, 5e-6, 1e-20);
  p.fast_used = 1;
  p.fade_rad_s = 169.0;
  for (double vel : {1.0, -1.0}) {
    EXPECT_NEAR(gear_correction(p, 0.0, vel).pos, 4e-6 / 17.0, 1e-20);
    EXPECT_NEAR(gear_correction(p, 0.0, vel).vel, vel * 676e-6 / 17.0, 1e-18);
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
    const auto c = backlash_correction(p, example::calibrated(p), example::flank(p), 0.0, side * 2.0,
                                       side * quarter, 0.0, 0.0, 0.0);
    EXPECT_NEAR(c.pos, side * 2.75e-5, 1e-18);
    EXPECT_NEAR(c.vel, side * 6.75e-6, 1e-18);
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
    const auto c =
        map_correction(p, example::calibrated(p), example::flank(p), side, 0.0, quarter, 0.0, 0.0, 0.0);
    EXPECT_NEAR(c.pos, 4e-5 + side * 1e-5, 1e-18);
    // A direction that turns round at 3 /s takes the lost motion with it.
    EXPECT_NEAR(
        map_correction(p, example::calibrated(p), example::flank(p), side, 3.0, quarter, 0.0, 0.0, 0.0).vel,
        3e-5, 1e-18);
  }
}

// 2 kN m of friction that is gone no longer wind 3e-9 rad/(N m) up: 6 of 10 urad each way.
TEST(Maps, lose_the_wind_up_of_friction_that_is_gone) {
  Params p;
  p.reversal = true;
  p.flank_nm = 1e3;
  p.pos_limit_rad = 1e-3;
  p.lost_motion.mean = 1e-5;
  p.compliance_rad_per_nm = 3e-9;
  const Flank<double> less{0.0, 4e3, 2e3};
  for (double side : {1.0, -1.0}) {
    EXPECT_NEAR(map_correction(p, {0.0, 0.0}, less, side, 0.0, 0.5, 0.1, 0.0, 0.0).pos, side * 4e-6, 1e-18);
    EXPECT_NEAR(map_correction(p, {0.0, 0.0}, less, side, 3.0, 0.5, 0.1, 0.0, 0.0).vel, 12e-6, 1e-18);
  }
}

}  // namespace
}  // namespace gantry
