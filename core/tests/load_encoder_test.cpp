// The encoder on the load as the plant has it: noise, steps, age and errors of its readings.
#include "core/plant/load_encoder.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>

#include "core/lane/pack.hpp"

namespace gantry {
namespace {

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
  // Plants of a pack have read as often as they have, and each its own noise.
  LoadEncoderParams<Pack<2>> both;
  both.noise_rad = Pack<2>(1e-6);
  Pack<2> number(1.0);
  set_lane(number, 1, 1000.0);
  const Pack<2> read = load_encoder_reading(both, Pack<2>(0.5), Pack<2>(0.0), number);
  EXPECT_NEAR(lane(read, 0), 0.5 - 1e-6 * 74702.0 / 37837.0, 1e-15);
  EXPECT_NEAR(lane(read, 1), 0.5 + 1e-6 * 56558.0 / 37837.0, 1e-15);
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
