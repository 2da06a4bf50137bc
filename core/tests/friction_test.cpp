// The elasto-plastic element: its gate, its steady state, its step.
#include "core/plant/friction.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace gantry {
namespace {

constexpr double kRatio = 0.6;

double sliding_gate(double v, double z, double inverse, double ep_ratio) {
  return gate_of(ep_ratio)(v, z, inverse);
}

TEST(SlidingGate, is_elastic_below_the_break_away_ratio) {
  for (double a : {0.0, 0.1, 0.59, 0.6}) {
    EXPECT_EQ(sliding_gate(1.0, a, 1.0, kRatio), 0.0) << a;
    EXPECT_EQ(sliding_gate(-1.0, -a, 1.0, kRatio), 0.0) << a;
  }
}

TEST(SlidingGate, slides_from_the_steady_state_on) {
  for (double a : {1.0, 1.01, 50.0}) {
    EXPECT_EQ(sliding_gate(1.0, a, 1.0, kRatio), 1.0) << a;
    EXPECT_EQ(sliding_gate(-1.0, -a, 1.0, kRatio), 1.0) << a;
  }
}

TEST(SlidingGate, blends_by_a_sine_between) {
  EXPECT_NEAR(sliding_gate(1.0, 0.8, 1.0, kRatio), 0.5, 1e-15);
  EXPECT_NEAR(sliding_gate(1.0, 0.7, 1.0, kRatio), 0.5 - 0.5 * std::sqrt(0.5), 1e-15);
  EXPECT_NEAR(sliding_gate(1.0, 0.9, 1.0, kRatio), 0.5 + 0.5 * std::sqrt(0.5), 1e-15);
  EXPECT_LT(sliding_gate(1.0, 0.6001, 1.0, kRatio), 1e-6);
  EXPECT_GT(sliding_gate(1.0, 0.9999, 1.0, kRatio), 1.0 - 1e-6);
}

TEST(SlidingGate, is_elastic_when_unloading_and_at_rest) {
  for (double z : {0.7, 1.0, 3.0}) {
    EXPECT_EQ(sliding_gate(-1.0, z, 1.0, kRatio), 0.0);
    EXPECT_EQ(sliding_gate(0.0, z, 1.0, kRatio), 0.0);
  }
  EXPECT_EQ(sliding_gate(1.0, 0.0, 1.0, kRatio), 0.0);
}

TEST(SlidingGate, scales_with_the_steady_state_and_obeys_its_ratio) {
  EXPECT_NEAR(sliding_gate(2.0, 4e-5, 1.0 / 5e-5, kRatio), 0.5, 1e-12);
  EXPECT_EQ(sliding_gate(1.0, 0.79, 1.0, 0.8), 0.0);
  EXPECT_NEAR(sliding_gate(1.0, 0.9, 1.0, 0.8), 0.5, 1e-14);
}

TEST(SlidingGate, of_an_element_without_strength) {
  const double infinite = std::numeric_limits<double>::infinity();
  EXPECT_EQ(sliding_gate(1.0, 0.0, infinite, kRatio), 0.0);
  EXPECT_EQ(sliding_gate(1.0, 1e-9, infinite, kRatio), 1.0);
}

// Fc = 5.5, Fs = 6.5, vs = 1, Fv = 0.03, z = 0.005, sigma1 coefficient 0.3, J = 0.362: the motor.
FrictionParams<double> motor() { return {5.5, 6.5, 1.0, 0.03, 0.005, 0.3, 0.362}; }

TEST(Friction, slides_steadily_at_the_stribeck_curve) {
  for (double v : {1e-3, 0.1, 0.5, 1.0, 2.0, 4.0, 8.0, 30.0, 120.0}) {
    const double g = 5.5 + 1.0 * std::exp(-v * v);
    const double z_ss = g / (5.5 / 0.005);
    const Friction<double> f = friction<false>(motor(), gate_of(kRatio), v, z_ss * (1.0 + 1e-15));
    EXPECT_NEAR(f.z_rate, 0.0, 1e-12 * v) << v;
    EXPECT_NEAR(f.torque, g + 0.03 * v, 1e-11) << v;
  }
}

// At its Stribeck speed of 2 rad/s exp(-1) of the difference is left.
TEST(Friction, stribeck_curve_has_its_speed) {
  const FrictionParams<double> p(5.0, 6.0, 2.0, 0.0, 0.005, 0.0, 1.0);
  const double level = 5.0 + std::exp(-1.0);
  EXPECT_NEAR(friction<false>(p, gate_of(kRatio), 2.0, 0.0051).slip_rate * level,
              2.0 * 1000.0 * sliding_gate(2.0, 0.0051, 1000.0 / level, kRatio), 1e-9);
}

TEST(Friction, is_odd_in_speed_and_state) {
  for (double v : {0.01, 1.0, 6.0})
    for (double z : {0.001, 0.0047, 0.0059}) {
      const Friction<double> a = friction<false>(motor(), gate_of(kRatio), v, z),
                             b = friction<false>(motor(), gate_of(kRatio), -v, -z);
      EXPECT_EQ(a.torque, -b.torque);
      EXPECT_EQ(a.z_rate, -b.z_rate);
      EXPECT_EQ(a.slip_rate, b.slip_rate);
    }
}

TEST(Friction, is_a_spring_with_micro_damping_before_it_slides) {
  const double v = 1e-4, z = 0.002, stiffness = 1100.0;
  const Friction<double> f = friction<false>(motor(), gate_of(kRatio), v, z);
  EXPECT_EQ(f.slip_rate, 0.0);
  EXPECT_EQ(f.z_rate, v);
  EXPECT_NEAR(f.torque, stiffness * z + (0.3 * std::sqrt(stiffness * 0.362) + 0.03) * v, 1e-12);
}

TEST(Friction, micro_damping_falls_with_speed) {
  for (double v : {1.0, 5.0, 10.0}) {
    const double s1 = 0.3 * std::sqrt(1100.0 * 0.362) * std::exp(-(v / 5.0) * (v / 5.0));
    const Friction<double> f = friction<false>(motor(), gate_of(kRatio), v, 0.0);
    EXPECT_NEAR(f.torque, (s1 + 0.03) * v, 1e-12) << v;
  }
  // beyond five times vs times the root of 28 nothing of it is left
  EXPECT_EQ(friction<false>(motor(), gate_of(kRatio), 27.0, 0.0).torque, 0.03 * 27.0);
}

TEST(Friction, load_torque_raises_the_level) {
  const double extra = 1.4, v = 50.0;
  const double z_ss = (5.5 + extra) / 1100.0;
  EXPECT_NEAR(friction<true>(motor(), gate_of(kRatio), v, z_ss * (1.0 + 1e-15), extra).torque,
              5.5 + extra + 0.03 * v, 1e-11);
  EXPECT_NEAR(friction<true>(motor(), gate_of(kRatio), v, z_ss * (1.0 + 1e-15), extra).z_rate, 0.0,
              1e-12 * v);
}

TEST(Friction, step_is_the_exact_solution_for_held_speed) {
  const double v = 2.0, dt = 125e-6;
  const double g = 5.5 + std::exp(-4.0), lambda = v * 1100.0 / g;
  const double z0 = 1.05 * g / 1100.0;  // sliding: the gate is 1
  const Friction<double> f = friction<false>(motor(), gate_of(kRatio), v, z0);
  EXPECT_NEAR(f.slip_rate, lambda, 1e-10);
  const double z1 = v / lambda + (z0 - v / lambda) * std::exp(-lambda * dt);
  EXPECT_NEAR(friction_step(z0, f, dt), z1, 1e-16);  // 1e-13 of the way v dt
}

TEST(Friction, step_stays_at_the_steady_state_however_stiff_it_is) {
  const double v = 120.0, dt = 125e-6;  // lambda dt = 3: beyond what an explicit step survives
  double z = 0.0;
  for (int k = 0; k < 1000; ++k) z = friction_step(z, friction<false>(motor(), gate_of(kRatio), v, z), dt);
  EXPECT_NEAR(z, 0.005, 1e-15);
}

TEST(Friction, mean_of_a_decay_agrees_with_libm) {
  EXPECT_EQ(decayed_mean(0.0), 1.0);
  for (double x : {1e-12, 1e-6, 1e-3, 0.1, 0.5, 1.0, 2.0, 3.0, 4.0})
    EXPECT_NEAR(decayed_mean(x), -std::expm1(-x) / x, 1e-13) << x;
}

TEST(Friction, step_is_exact_on_both_sides_of_the_range_of_the_mean) {
  for (double x : {3.999999, 4.0, 4.000001, 5.9, 30.0, 1e5}) {
    Friction<double> f;
    f.z_rate = 1.0;
    f.slip_rate = x;
    EXPECT_NEAR(friction_step(0.0, f, 1.0), -std::expm1(-x) / x, 1e-13) << x;
  }
}

// Only the viscous part is left, slow and fast.
TEST(Friction, of_an_element_without_strength_is_viscous) {
  const FrictionParams<double> p(0.0, 0.0, 1.0, 5.0, 1e-3, 0.3, 1.0);
  for (double v : {0.0, 0.1, 100.0}) EXPECT_EQ(friction<false>(p, gate_of(kRatio), v, 0.0).torque, 5.0 * v);
}

// 0.5 N m sliding, 0.6 N m before, over 1 mrad: it slides steadily at 1 mrad, and 0.2 mrad later when slow.
TEST(Friction, of_a_weak_element_is_that_of_a_strong_one) {
  const FrictionParams<double> p(0.5, 0.6, 1.0, 0.0, 1e-3, 0.0, 1.0);
  EXPECT_NEAR(friction<false>(p, gate_of(kRatio), 50.0, 1e-3).z_rate, 0.0, 1e-12);
  EXPECT_NEAR(friction<false>(p, gate_of(kRatio), 1e-9, 1.2e-3).slip_rate, 1e-9 / 1.2e-3, 1e-18);
}

TEST(Friction, of_nan_is_nan) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(std::isnan(friction<false>(motor(), gate_of(kRatio), nan, 0.0).torque));
  EXPECT_TRUE(std::isnan(friction<false>(motor(), gate_of(kRatio), 1.0, nan).torque));
}

// A contact that ages in 4 s and is worn off over 6 rad, 2 rad of spring turned over at 3 /s: 1/4 + 3 x 2
// / 6.
TEST(Friction, contacts_age_at_rest_and_lose_it_in_motion) {
  Friction<double> f;
  for (double z : {2.0, -2.0}) {
    f.slip_rate = 3.0;
    EXPECT_NEAR(ageing(f, z, 0.25, 4.0, 6.0).slip_rate, 1.25, 1e-15);
    EXPECT_NEAR(ageing(f, z, 0.25, 4.0, 6.0).z_rate, 0.25 - 0.3125, 1e-15);
    f.slip_rate = 0.0;
    EXPECT_NEAR(ageing(f, z, 1.0, 4.0, 6.0).z_rate, 0.0, 1e-15);
  }
}

}  // namespace
}  // namespace gantry
