// The lane functions of plain numbers and of packs, and the elementary functions against the C library.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "core/lane/counted.hpp"
#include "core/lane/elementary.hpp"
#include "core/lane/pack.hpp"
#include "core/lane/twin.hpp"

namespace gantry {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kPi = 3.141592653589793;

// The bounds stated in elementary.hpp: absolute for sine and cosine, relative for the exponential.
constexpr double kSinCosError = 1e-15;
constexpr double kExpError = 1e-15;

void expect_sincos(double x) {
  const SinCos<double> r = sincos(x);
  EXPECT_NEAR(r.sin, std::sin(x), kSinCosError) << "x = " << x;
  EXPECT_NEAR(r.cos, std::cos(x), kSinCosError) << "x = " << x;
}

TEST(SinCos, agrees_with_libm_over_the_angles_of_the_motor) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> angle(-5e4, 5e4);
  for (int k = 0; k < 200000; ++k) expect_sincos(angle(random));
}

TEST(SinCos, agrees_with_libm_near_zero) {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> angle(-4.0, 4.0);
  for (int k = 0; k < 50000; ++k) expect_sincos(angle(random));
}

TEST(SinCos, agrees_with_libm_at_the_seams_of_the_quarters) {
  for (int quarter = -31000; quarter <= 31000; ++quarter)
    for (double offset : {0.0, kPi / 4.0, 1e-9, -1e-9, std::nextafter(kPi / 4.0, 0.0)})
      expect_sincos(quarter * (kPi / 2.0) + offset);
}

TEST(SinCos, agrees_with_libm_up_to_its_stated_limit) {
  for (double x : {1e5, -1e5, 3.3e5, 999999.0, -999999.5}) expect_sincos(x);
}

TEST(SinPi, agrees_with_libm_over_its_range) {
  for (int k = -500; k <= 500; ++k)
    EXPECT_NEAR(sin_pi(0.001 * k), std::sin(kPi * 0.001 * k), kSinCosError) << k;
}

// What the series leave out: the next term.
TEST(SinCosSmall, is_off_by_the_next_term_of_the_series) {
  for (double d : {-0.5, -0.1, -0.003, 0.0, 1e-9, 0.02, 0.2, 0.5}) {
    const double z = d * d, rounding = 2e-16;
    const SinCos<double> two = sincos_small<2>(d), three = sincos_small<3>(d), four = sincos_small<4>(d);
    EXPECT_NEAR(two.sin, std::sin(d), std::fabs(d) * z * z / 120 + rounding) << d;
    EXPECT_NEAR(two.cos, std::cos(d), z * z / 24 + rounding) << d;
    EXPECT_NEAR(three.sin, std::sin(d), std::fabs(d) * z * z * z / 5040 + rounding) << d;
    EXPECT_NEAR(three.cos, std::cos(d), z * z * z / 720 + rounding) << d;
    EXPECT_NEAR(four.sin, std::sin(d), std::fabs(d) * z * z * z * z / 362880 + rounding) << d;
    EXPECT_NEAR(four.cos, std::cos(d), z * z * z * z / 40320 + rounding) << d;
  }
}

TEST(SinCos, multiples_come_from_one_sine_and_cosine) {
  for (double x : {-2.0, 0.3, 1.7})
    for (int n : {1, 2, 3, 4, 7, 12, 26, 48}) {
      const SinCos<double> r = multiple(sincos(x), n);
      EXPECT_NEAR(r.sin, std::sin(n * x), 1e-15 * n);
      EXPECT_NEAR(r.cos, std::cos(n * x), 1e-15 * n);
    }
}

TEST(SinCos, is_exact_where_it_must_be) {
  EXPECT_EQ(sincos(0.0).sin, 0.0);
  EXPECT_EQ(sincos(0.0).cos, 1.0);
  EXPECT_EQ(sincos(1e-300).sin, 1e-300);
  for (double x : {0.1, 1.0, 2.0, 3.0, 12345.6}) {
    EXPECT_EQ(sincos(-x).sin, -sincos(x).sin);
    EXPECT_EQ(sincos(-x).cos, sincos(x).cos);
  }
}

TEST(SinCos, of_nan_is_nan) {
  EXPECT_TRUE(std::isnan(sincos(kNaN).sin));
  EXPECT_TRUE(std::isnan(sincos(kNaN).cos));
  EXPECT_TRUE(std::isnan(sincos(kInfinity).sin));
}

TEST(SinCos, angle_sum_is_the_addition_theorem) {
  for (double a : {-2.0, 0.3, 1.7})
    for (double b : {-1.1, 0.0, 2.9}) {
      const SinCos<double> r = angle_sum(sincos(a), sincos(b));
      EXPECT_NEAR(r.sin, std::sin(a + b), 5e-16);
      EXPECT_NEAR(r.cos, std::cos(a + b), 5e-16);
    }
}

TEST(Exp, agrees_with_libm) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> wide(-708.0, 709.0), narrow(-1.0, 1.0);
  for (int k = 0; k < 200000; ++k) {
    const double x = k % 2 ? wide(random) : narrow(random);
    const double exact = std::exp(x);
    EXPECT_NEAR(vexp(x), exact, kExpError * exact) << "x = " << x;
  }
  EXPECT_EQ(vexp(0.0), 1.0);
}

TEST(Exp, never_becomes_subnormal) {
  const double least = vexp(-708.0);
  EXPECT_EQ(std::fpclassify(least), FP_NORMAL);
  for (double x : {-708.5, -745.0, -1e5, -kInfinity}) EXPECT_EQ(vexp(x), least) << "x = " << x;
}

TEST(Exp, of_nan_is_nan) { EXPECT_TRUE(std::isnan(vexp(kNaN))); }

TEST(Pow2, is_exact_over_all_normal_exponents) {
  for (int n = -1022; n <= 1023; ++n) EXPECT_EQ(pow2(static_cast<double>(n)), std::ldexp(1.0, n)) << n;
}

TEST(Round, takes_halves_to_the_even_neighbour) {
  const double halves[][2] = {{0.5, 0.0},  {1.5, 2.0},   {2.5, 2.0},  {3.5, 4.0},
                              {-0.5, 0.0}, {-1.5, -2.0}, {-2.5, -2.0}};
  for (const auto& [x, rounded] : halves) EXPECT_EQ(vround(x), rounded) << "x = " << x;
}

TEST(Round, agrees_with_libm_up_to_two_to_the_fifty) {
  std::mt19937_64 random(4);
  for (double range : {1.0, 1e3, 1e9, 1e15}) {
    std::uniform_real_distribution<double> number(-range, range);
    for (int k = 0; k < 10000; ++k) {
      const double x = number(random);
      EXPECT_EQ(vround(x), std::nearbyint(x)) << "x = " << x;
    }
  }
}

TEST(Clamp, limits_on_both_sides) {
  EXPECT_EQ(clamp(0.5, -1.0, 2.0), 0.5);
  EXPECT_EQ(clamp(-7.0, -1.0, 2.0), -1.0);
  EXPECT_EQ(clamp(7.0, -1.0, 2.0), 2.0);
  EXPECT_EQ(clamp(kInfinity, -1.0, 2.0), 2.0);
  EXPECT_EQ(clamp(-kInfinity, -1.0, 2.0), -1.0);
}

TEST(Smaller, and_larger_take_the_second_of_equal_ones_and_for_nan) {
  EXPECT_EQ(smaller(1.0, 2.0), 1.0);
  EXPECT_EQ(smaller(2.0, 1.0), 1.0);
  EXPECT_EQ(larger(1.0, 2.0), 2.0);
  EXPECT_EQ(larger(2.0, 1.0), 2.0);
  EXPECT_EQ(smaller(kNaN, 1.0), 1.0);
  EXPECT_EQ(larger(kNaN, 1.0), 1.0);
  EXPECT_TRUE(std::signbit(smaller(0.0, -0.0)));
  EXPECT_TRUE(std::signbit(larger(0.0, -0.0)));
}

TEST(Clamp, lets_nan_through) {
  EXPECT_TRUE(std::isnan(clamp(kNaN, -1.0, 2.0)));
  const Pack<4> lanes = clamp(Pack<4>(kNaN), Pack<4>(-1.0), Pack<4>(2.0));
  for (int k = 0; k < 4; ++k) EXPECT_TRUE(std::isnan(lanes.lane[k]));
}

TEST(FlushSubnormal, removes_what_is_tiny_and_nothing_else) {
  for (double x : {5e-324, 1e-310, 2e-308, 1e-250, 1e-217, -1e-310, -1e-250})
    EXPECT_EQ(flush_subnormal(x), 0.0) << x;
  for (double x : {1e-180, 1e-30, 1.0, 1e30, -1e-180, -3.3, 0.0}) EXPECT_EQ(flush_subnormal(x), x);
  EXPECT_TRUE(std::isnan(flush_subnormal(kNaN)));
}

TEST(Sign, counts_zero_as_positive) {
  EXPECT_EQ(sign(3.0), 1.0);
  EXPECT_EQ(sign(0.0), 1.0);
  EXPECT_EQ(sign(-1e-300), -1.0);
}

template <class P>
P random_pack(std::mt19937_64& random) {
  std::uniform_real_distribution<double> number(-9.0, 9.0);
  P p;
  for (int k = 0; k < kLanes<P>; ++k) set_lane(p, k, number(random));
  return p;
}

template <class P>
void expect_lanes(const P& pack, const P& a, const P& b, double (*scalar)(double, double)) {
  for (int k = 0; k < kLanes<P>; ++k)
    EXPECT_EQ(lane(pack, k), scalar(lane(a, k), lane(b, k))) << "lane " << k;
}

template <class P>
class PackOf : public testing::Test {};
using Packs = testing::Types<Pack<2>, Pack<4>, Pack<8>, Twin<Pack<2>>, Twin<Pack<4>>>;
TYPED_TEST_SUITE(PackOf, Packs, );  // the comma: Clang asks for the argument that may be left out

TYPED_TEST(PackOf, numbers_computes_lane_by_lane) {
  using P = TypeParam;
  std::mt19937_64 random(5);
  const P a = random_pack<P>(random), b = random_pack<P>(random);
  expect_lanes(a + b, a, b, [](double x, double y) { return x + y; });
  expect_lanes(a - b, a, b, [](double x, double y) { return x - y; });
  expect_lanes(a * b, a, b, [](double x, double y) { return x * y; });
  expect_lanes(a / b, a, b, [](double x, double y) { return x / y; });
  expect_lanes(-a, a, b, [](double x, double) { return -x; });
  expect_lanes(vabs(a), a, b, [](double x, double) { return std::fabs(x); });
  expect_lanes(vsqrt(vabs(a)), a, b, [](double x, double) { return std::sqrt(std::fabs(x)); });
  expect_lanes(select(a < b, a, b), a, b, [](double x, double y) { return x < y ? x : y; });
  expect_lanes(select(a >= b, a, b), a, b, [](double x, double y) { return x >= y ? x : y; });
  expect_lanes(select(negate(a > b), a, b), a, b, [](double x, double y) { return x > y ? y : x; });
  expect_lanes(select(both(a > P(0.0), b > P(0.0)), a, b), a, b,
               [](double x, double y) { return x > 0.0 && y > 0.0 ? x : y; });
  expect_lanes(select(either(a > P(0.0), b > P(0.0)), a, b), a, b,
               [](double x, double y) { return x > 0.0 || y > 0.0 ? x : y; });
  expect_lanes(select(differ(a > P(0.0), b > P(0.0)), a, b), a, b,
               [](double x, double y) { return (x > 0.0) != (y > 0.0) ? x : y; });
}

TYPED_TEST(PackOf, numbers_has_the_elementary_functions_of_a_number) {
  using P = TypeParam;
  std::mt19937_64 random(6);
  for (int k = 0; k < 1000; ++k) {
    const P a = random_pack<P>(random) * P(1000.0);
    expect_lanes(sincos(a).sin, a, a, [](double x, double) { return sincos(x).sin; });
    expect_lanes(sincos(a).cos, a, a, [](double x, double) { return sincos(x).cos; });
    expect_lanes(vexp(-vabs(a)), a, a, [](double x, double) { return vexp(-std::fabs(x)); });
    expect_lanes(pow2(vround(a * P(0.1))), a, a, [](double x, double) { return pow2(vround(x * 0.1)); });
    expect_lanes(vround(a), a, a, [](double x, double) { return vround(x); });
    expect_lanes(sign(a), a, a, [](double x, double) { return sign(x); });
    expect_lanes(flush_subnormal(a * P(1e-220)), a, a,
                 [](double x, double) { return flush_subnormal(x * 1e-220); });
  }
}

TYPED_TEST(PackOf, numbers_is_a_number_in_every_lane_with_its_sign) {
  using P = TypeParam;
  for (double number : {0.0, -0.0, 3.0, -3.0})
    for (int k = 0; k < kLanes<P>; ++k) {
      EXPECT_EQ(lane(P(number), k), number);
      EXPECT_EQ(std::signbit(lane(P(number), k)), std::signbit(number));
    }
}

TYPED_TEST(PackOf, masks_is_any_lane) {
  using P = TypeParam;
  P a(0.0);
  EXPECT_FALSE(any(a > P(0.0)));
  for (int k = 0; k < kLanes<P>; ++k) {
    set_lane(a, k, 1.0);
    EXPECT_TRUE(any(a > P(0.0)));
    for (int other = 0; other < kLanes<P>; ++other) EXPECT_EQ(lane(a > P(0.0), other), other == k);
    set_lane(a, k, 0.0);
  }
  MaskOf<P> m = mask<P>(false);
  for (int k = 0; k < kLanes<P>; ++k) {
    set_lane(m, k, true);
    for (int other = 0; other < kLanes<P>; ++other) EXPECT_EQ(lane(m, other), other == k);
    EXPECT_TRUE(any(m));
    set_lane(m, k, false);
    EXPECT_FALSE(any(m));
  }
  EXPECT_FALSE(any(negate(a >= P(0.0))));
  EXPECT_TRUE(any(a == P(0.0)));
}

// A choice is no arithmetic, a root counts as a division, a power of two as an addition.
TEST(Counted, tells_what_was_done_with_its_numbers) {
  operations = {};
  Counted a = 3.0;
  set_lane(a, 0, 4.0);
  const Counted b = -a + Counted(2.0), c = select(a < b, a, vabs(b)) * vsqrt(a) / pow2(Counted(2.0));
  EXPECT_EQ(lane(b, 0), -2.0);
  EXPECT_EQ(lane(c, 0), 1.0);
  EXPECT_EQ(lane(select(a > b, a, b), 0), 4.0);
  EXPECT_EQ(operations.add, 2);
  EXPECT_EQ(operations.multiply, 1);
  EXPECT_EQ(operations.divide, 2);
  EXPECT_EQ(operations.choose, 4);
  EXPECT_EQ(operations.arithmetic(), 5);
}

}  // namespace
}  // namespace gantry
