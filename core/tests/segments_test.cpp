// Set-point plans: sampling inside, before and after; extremes; what happens at the seams.
#include "core/control/segments.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <random>

namespace gantry {
namespace {

// One second of constant jerk, two of constant speed, one of constant deceleration, then 0.25 rad/s.
Segments plan() {
  const double vel = 0.5 + 0.5 * 1.5;
  const double pos_1 = 2.0 + 0.5 + 1.5 / 6.0, pos_3 = pos_1 + 2.0 * vel;
  return {{{0.0, 2.0, 0.5, 0.0, 1.5}, {1.0, pos_1, vel, 0.0, 0.0}, {3.0, pos_3, vel, -1.0, 0.0}},
          4.0,
          pos_3 + vel - 0.5,
          vel - 1.0};
}

void expect_point(const SetPoint<double>& r, double pos, double vel, double acc) {
  EXPECT_NEAR(r.pos, pos, 1e-15 * 10.0);
  EXPECT_NEAR(r.vel, vel, 1e-15 * 10.0);
  EXPECT_NEAR(r.acc, acc, 1e-15 * 10.0);
}

TEST(Segments, sample_is_the_polynomial_of_its_segment) {
  expect_point(plan().sample(0.0), 2.0, 0.5, 0.0);
  expect_point(plan().sample(0.5), 2.0 + 0.25 + 1.5 * 0.125 / 6.0, 0.5 + 1.5 * 0.125, 0.75);
  expect_point(plan().sample(2.0), 2.75 + 1.25, 1.25, 0.0);
  expect_point(plan().sample(3.5), 2.75 + 2.5 + 0.625 - 0.125, 0.75, -1.0);
}

TEST(Segments, a_seam_belongs_to_the_later_segment) {
  EXPECT_EQ(plan().sample(1.0).acc, 0.0);
  EXPECT_EQ(plan().sample(3.0).acc, -1.0);
  EXPECT_EQ(plan().sample(std::nextafter(3.0, 0.0)).acc, 0.0);
}

TEST(Segments, position_and_speed_are_continuous_over_the_seams) {
  for (double seam : {1.0, 3.0, 4.0}) {
    const SetPoint<double> before = plan().sample(std::nextafter(seam, 0.0)), after = plan().sample(seam);
    EXPECT_NEAR(before.pos, after.pos, 1e-14);
    EXPECT_NEAR(before.vel, after.vel, 1e-14);
  }
}

TEST(Segments, goes_on_at_its_final_speed_after_the_end) {
  const Segments s = plan();
  expect_point(s.sample(4.0), s.pos_end(), 0.25, 0.0);
  expect_point(s.sample(10.0), s.pos_end() + 6.0 * 0.25, 0.25, 0.0);
}

TEST(Segments, ends_exactly_where_it_was_told_to) {
  const Segments s({{0.0, 0.0, 0.1, 0.0, 0.0}}, 3.0, 0.3, 0.0);
  for (double t : {3.0, 3.001, 1e6}) {
    EXPECT_EQ(s.sample(t).pos, 0.3);
    EXPECT_EQ(s.sample(t).vel, 0.0);
    EXPECT_EQ(s.sample(t).acc, 0.0);
  }
}

TEST(Segments, before_the_start_is_the_first_state) {
  EXPECT_EQ(plan().sample(-1.0).pos, 2.0);
  EXPECT_EQ(plan().sample(-1.0).vel, 0.5);
}

TEST(Segments, without_segments_holds_its_end) {
  const Segments s({}, 0.0, 1.25, 0.0);
  for (double t : {-1.0, 0.0, 5.0}) EXPECT_EQ(s.sample(t).pos, 1.25);
  double lowest, highest;
  s.extremes(lowest, highest);
  EXPECT_EQ(lowest, 1.25);
  EXPECT_EQ(highest, 1.25);
}

TEST(Segments, a_plan_of_nothing_stands_at_zero) {
  for (double t : {0.0, 0.5, 3.0}) expect_point(Segments().sample(t), 0.0, 0.0, 0.0);
  EXPECT_EQ(Segments().duration(), 0.0);
}

// A plan that jumps back after a second at 1 rad/s has been at 1 rad, just before the jump.
TEST(Segments, extremes_look_at_the_end_of_every_segment) {
  for (double side : {1.0, -1.0}) {
    const Segments jumps{{{0.0, 0.0, side, 0.0, 0.0}, {1.0, 0.0, 0.0, 0.0, 0.0}}, 2.0, 0.0, 0.0};
    double lowest = 0.0, highest = 0.0;
    jumps.extremes(lowest, highest);
    EXPECT_EQ(lowest, side > 0.0 ? 0.0 : -1.0);
    EXPECT_EQ(highest, side > 0.0 ? 1.0 : 0.0);
  }
}

TEST(Segments, a_time_that_is_no_number_gives_the_end) {
  EXPECT_EQ(plan().sample(std::numeric_limits<double>::quiet_NaN()).pos, plan().pos_end());
}

TEST(Segments, extremes_of_a_turn_back_are_at_its_standstill) {
  // speed 1 - t: highest at t = 1, back at the start at t = 2, below it until 3
  const Segments s({{0.0, 5.0, 1.0, -1.0, 0.0}}, 3.0, 5.0 + 3.0 - 4.5, -2.0);
  double lowest, highest;
  s.extremes(lowest, highest);
  EXPECT_DOUBLE_EQ(highest, 5.5);
  EXPECT_DOUBLE_EQ(lowest, 3.5);
}

TEST(Segments, extremes_find_both_standstills_of_a_jerk_segment) {
  // speed (t - 1)(t - 2): highest at t = 1, lowest of the inside at t = 2
  const Segments s({{0.0, 0.0, 2.0, -3.0, 2.0}}, 2.5, 0.0, 0.0);
  const auto pos = [](double t) { return t * t * t / 3.0 - 1.5 * t * t + 2.0 * t; };
  double lowest, highest;
  Segments(s.segments(), 2.5, pos(2.5), 0.75).extremes(lowest, highest);
  EXPECT_NEAR(highest, pos(1.0), 1e-15);
  EXPECT_EQ(lowest, 0.0);
  Segments({{0.0, pos(1.2), (0.2) * (-0.8), -3.0 + 2.4, 2.0}}, 1.0, pos(2.2), 0.24).extremes(lowest, highest);
  EXPECT_NEAR(lowest, pos(2.0), 1e-15);
}

TEST(Segments, extremes_stay_exact_when_the_jerk_is_almost_nothing) {
  const Segments s({{0.0, 0.0, 1.0, -1.0, 1e-18}}, 2.0, 0.0, -1.0);
  double lowest, highest;
  s.extremes(lowest, highest);
  EXPECT_NEAR(highest, 0.5, 1e-15);
}

// A continuous plan of random segments, as a planner would make it.
Segments random_plan(std::mt19937_64& random, double duration_factor = 1.0) {
  std::uniform_real_distribution<double> number(-1.0, 1.0), length(0.05, 1.0);
  std::vector<Segments::Segment> segments;
  double t = 0.0;
  SetPoint<double> x{number(random), number(random), number(random)};
  for (int k = 0; k < 5; ++k) {
    const double jerk = k % 2 ? 3.0 * number(random) : 0.0, dt = length(random);
    segments.push_back({t, x.pos, x.vel, x.acc, jerk});
    x = Segments({segments.back()}, t + dt, 0.0, 0.0).sample(std::nextafter(t + dt, 0.0));
    t += dt;
  }
  const double duration = t * duration_factor;
  x = Segments(segments, t, x.pos, x.vel).sample(duration);
  return {segments, duration, x.pos, x.vel};
}

void expect_extremes(const Segments& s) {
  double lowest, highest, seen_lowest = 1e9, seen_highest = -1e9;
  s.extremes(lowest, highest);
  for (int k = 0; k <= 4000; ++k) {
    const double pos = s.sample(s.duration() * k / 4000.0).pos;
    seen_lowest = std::min(seen_lowest, pos);
    seen_highest = std::max(seen_highest, pos);
  }
  EXPECT_LE(lowest, seen_lowest + 1e-12);
  EXPECT_GE(highest, seen_highest - 1e-12);
  // between two samples 1.2 ms apart a position within |acc| <= 20 rad/s2 hides at most acc dt^2 / 8
  EXPECT_NEAR(lowest, seen_lowest, 5e-6);
  EXPECT_NEAR(highest, seen_highest, 5e-6);
}

TEST(Segments, extremes_of_random_plans_are_those_of_dense_sampling) {
  std::mt19937_64 random(7);
  for (int k = 0; k < 300; ++k) expect_extremes(random_plan(random));
}

TEST(Segments, extremes_look_no_further_than_the_duration) {
  std::mt19937_64 random(8);
  for (int k = 0; k < 300; ++k) expect_extremes(random_plan(random, 0.4));
}

}  // namespace
}  // namespace gantry
