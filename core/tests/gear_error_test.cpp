// Errors of gears, single teeth and wind at angles and times where they are known by hand.
#include "core/plant/gear_error.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/plant/anchor.hpp"

namespace gantry {
namespace {

constexpr double kPi = 3.141592653589793;

// 2 sin(x + 30 deg).
TEST(GearError, a_wave_has_its_amplitude_and_phase) {
  const Harmonic<double> h(2.0, kPi / 6.0);
  EXPECT_NEAR(h.at(kPi / 3.0).error, 2.0, 1e-14);
  EXPECT_NEAR(h.at(kPi / 3.0).slope, 0.0, 1e-14);
  EXPECT_NEAR(h.at(0.0).error, 1.0, 1e-14);
  EXPECT_NEAR(h.at(0.0).slope, std::sqrt(3.0), 1e-14);
  EXPECT_EQ(Harmonic<double>().at(0.7).error, 0.0);
  EXPECT_EQ(Harmonic<double>().at(0.7).slope, 0.0);
}

TEST(GearError, of_the_ring_is_the_sum_of_its_waves_with_slope_and_curvature) {
  for (std::size_t k = 0; k < static_cast<std::size_t>(kRingHarmonics); ++k) {
    PlantParams<double> p;
    p.error_ring_rad[k] = 3e-5;
    p.phase_ring_rad[k] = 0.5;
    const double n = static_cast<double>(k) + 1.0;
    const auto found = GearError<double>(p).ring_error(0.4);
    EXPECT_EQ(found.rho, 0.4);
    EXPECT_NEAR(found.error, 3e-5 * std::sin(n * 0.4 + 0.5), 1e-18);
    EXPECT_NEAR(found.slope, n * 3e-5 * std::cos(n * 0.4 + 0.5), 1e-17);
    EXPECT_NEAR(found.curvature, -n * n * 3e-5 * std::sin(n * 0.4 + 0.5), 1e-16);
  }
}

// 1 + 2 x + 4 x^2 / 2 half a radian further on.
TEST(GearError, of_the_ring_goes_on_to_the_second_order) {
  const RingError<double> from{0.25, 1.0, 2.0, 4.0};
  EXPECT_NEAR(from.at(0.75).error, 2.5, 1e-15);
  EXPECT_NEAR(from.at(0.75).slope, 4.0, 1e-15);
  EXPECT_NEAR(from.at(-0.25).error, 0.5, 1e-15);
  EXPECT_NEAR(from.at(-0.25).slope, 0.0, 1e-15);
  EXPECT_EQ(RingError<double>().at(0.3).error, 0.0);
  EXPECT_EQ(RingError<double>().at(0.3).slope, 0.0);
}

// Once, twice and four times per turn of the motor, once per turn of the pinion (two of the motor), five
// teeth of it.
TEST(GearError, of_the_motor_side_is_the_sum_of_its_five_waves) {
  PlantParams<double> p;
  p.reducer_ratio = 2.0;
  p.pinion_teeth = 5;
  double* const amplitudes[] = {&p.error_reducer_1x_rad, &p.error_reducer_2x_rad, &p.error_reducer_4x_rad,
                                &p.error_pinion_rad, &p.error_mesh_rad};
  const double cycles[] = {1.0, 2.0, 4.0, 0.5, 2.5};
  for (std::size_t k = 0; k < 5; ++k) {
    for (double* amplitude : amplitudes) *amplitude = 0.0;
    *amplitudes[k] = 1e-6;
    const GearError<double> gear(p);
    for (double x : {0.3, -1.1}) {
      EXPECT_NEAR(gear.motor_error(x).error, 1e-6 * std::sin(cycles[k] * x), 1e-20);
      EXPECT_NEAR(gear.motor_error(x).slope, 1e-6 * cycles[k] * std::cos(cycles[k] * x), 1e-19);
    }
  }
}

// Half a radian of the motor at most, 0.2 rad of the teeth, 0.03 rad of the pinion.
TEST(GearError, waves_are_continued_within_their_reach) {
  const auto reach = [](double ratio, int teeth) {
    PlantParams<double> p;
    p.reducer_ratio = ratio;
    p.pinion_teeth = teeth;
    return GearError<double>(p).reach;
  };
  EXPECT_NEAR(reach(88.0, 26), 0.5, 1e-15);
  EXPECT_NEAR(reach(2.0, 50), 0.008, 1e-15);
  EXPECT_NEAR(reach(2.0, 1), 0.06, 1e-15);
}

// Four teeth, the second 4 urad ahead and the last 2 urad behind; one and a half in mesh. The error passes on
// over the last half of a pitch: a half of it in the middle, 10 w^3 - 15 w^4 + 6 w^5 = 0.94208 at w = 0.8.
TEST(ToothPitch, passes_from_one_tooth_to_the_next) {
  PlantParams<double> p;
  p.ring_teeth = 4;
  p.contact_ratio = 1.5;
  p.pitch.ring_rad[1] = 4e-6;
  p.pitch.ring_rad[3] = -2e-6;
  const auto at = [&](double units) { return ring_pitch_error(p, units * kPi / 2.0); };
  EXPECT_NEAR(at(0.25).error, 0.0, 1e-20);
  EXPECT_NEAR(at(0.75).error, 2e-6, 1e-18);
  EXPECT_NEAR(at(0.9).error, 3.76832e-6, 1e-18);
  EXPECT_NEAR(at(1.25).error, 4e-6, 1e-18);
  EXPECT_NEAR(at(1.25).slope, 0.0, 1e-18);
  EXPECT_NEAR(at(-0.25).error, -1e-6, 1e-18);   // the last tooth is also the one before the first
  EXPECT_NEAR(at(-12.25).error, -1e-6, 1e-18);  // three turns before it
  EXPECT_NEAR(at(3.75).error, -1e-6, 1e-18);
  // w passes at 2 x 4 / (2 pi) per radian: slope 30 w^2 (1-w)^2, curvature 60 w (1-w) (1-2w) of it.
  const double rate = 4.0 / kPi;
  EXPECT_NEAR(at(0.75).slope, 4e-6 * rate * 1.875, 1e-17);
  EXPECT_NEAR(at(0.9).slope, 4e-6 * rate * 0.768, 1e-17);
  EXPECT_NEAR(at(0.9).curvature, 4e-6 * rate * rate * -5.76, 1e-16);
  p.contact_ratio = 2.0;  // then it passes on all the time: 10 w^3 - 15 w^4 + 6 w^5 = 0.00856 at w = 0.1
  EXPECT_NEAR(at(0.1).error, 3.424e-8, 1e-20);
}

// Two teeth of a pinion that turns half as fast as the motor: three quarters of a pitch are 270 deg of the
// motor.
TEST(ToothPitch, of_the_pinion_goes_with_the_motor_through_the_reducer) {
  PlantParams<double> p;
  p.pinion_teeth = 2;
  p.reducer_ratio = 2.0;
  p.contact_ratio = 1.5;
  p.pitch.pinion_rad[1] = 4e-6;
  EXPECT_NEAR(pinion_pitch_error(p, 1.5 * kPi).error, 2e-6, 1e-18);
  EXPECT_NEAR(pinion_pitch_error(p, 2.5 * kPi).error, 4e-6, 1e-18);
  EXPECT_NEAR(pinion_pitch_error(p, -0.5 * kPi).error, 2e-6, 1e-18);
  EXPECT_NEAR(pinion_pitch_error(p, -12.5 * kPi).error, 2e-6, 1e-17);  // three turns before it
  p.pitch.second_pinion_rad[1] = 8e-6;
  EXPECT_NEAR(pinion_pitch_error(p, 1.5 * kPi, Pinion::kSecond).error, 4e-6, 1e-18);
}

// Four waves in a turn, at their top where the second of four teeth is 0.9 of a pitch behind: errors, slopes
// and curvatures of both, of which the wave has no slope there.
TEST(Anchor, ring_has_the_errors_of_its_waves_and_of_its_teeth) {
  PlantParams<double> p;
  p.gear_error = p.tooth_pitch = true;
  p.ring_teeth = 4;
  p.contact_ratio = 1.5;
  p.pitch.ring_rad[1] = 4e-6;
  p.error_ring_rad[3] = 1e-6;
  p.phase_ring_rad[3] = 0.5 * kPi - 1.8 * kPi;
  PlantState<double> x;
  x.pos_load = 0.3 + 0.45 * kPi;
  x.pos_base = 0.3;
  const Anchor<double> anchor(p, GearError<double>(p), GearError<double>(p), x, 0.0);
  const double rate = 4.0 / kPi;
  EXPECT_NEAR(anchor.first.ring.error, 1e-6 + 3.76832e-6, 1e-17);
  EXPECT_NEAR(anchor.first.ring.slope, 4e-6 * rate * 0.768, 1e-16);
  EXPECT_NEAR(anchor.first.ring.curvature, -16e-6 - 4e-6 * rate * rate * 5.76, 1e-15);
  EXPECT_NEAR(anchor.first.ring.rho, 0.45 * kPi, 1e-15);
}

// No waves, no teeth, a motor at 0.
TEST(Anchor, has_nothing_of_a_pinion_that_is_not_there) {
  PlantState<double> x;
  x.pos_motor_2 = 3.0;
  const PlantParams<double> p;
  const GearError<double> gear(p);
  const Anchor<double> anchor(p, gear, gear, x, 0.0);
  EXPECT_EQ(anchor.wind, 0.0);
  const TrainAnchor<double>& second = anchor.second;
  for (const RingError<double>& none : {second.ring, second.pinion_pitch})
    for (double each : {none.rho, none.error, none.slope, none.curvature}) EXPECT_EQ(each, 0.0);
  EXPECT_EQ(second.waves.pos, 0.0);
  EXPECT_EQ(second.waves.motor.sin, 0.0);
  EXPECT_EQ(second.waves.motor.cos, 1.0);
  for (const ErrorValue<double>& none : {second.waves.turn, second.waves.tooth}) {
    EXPECT_EQ(none.error, 0.0);
    EXPECT_EQ(none.slope, 0.0);
  }
}

// 30 N m and a gust of 10 sin(0.1 t + 0.2), which has half its size after 5 s and all of it from 10 s on.
TEST(Wind, rises_within_ten_seconds) {
  PlantParams<double> p;
  p.wind_moment_nm = 30.0;
  p.wind_wave_nm[1] = 10.0;
  p.wind_rate_rad_s[1] = 0.1;
  p.wind_phase_rad[1] = 0.2;
  p.wind_rate_rad_s[0] = 0.3;  // of a wave without size
  p.wind_phase_rad[0] = 0.5;
  EXPECT_NEAR(wind_moment(p, 0.0), 30.0, 1e-12);
  EXPECT_NEAR(wind_moment(p, 5.0), 30.0 + 5.0 * std::sin(0.7), 1e-12);
  EXPECT_NEAR(wind_moment(p, 20.0), 30.0 + 10.0 * std::sin(2.2), 1e-12);
  p.wind_wave_nm[0] = 7.0;
  EXPECT_NEAR(wind_moment(p, 20.0), 30.0 + 10.0 * std::sin(2.2) + 7.0 * std::sin(6.5), 1e-12);
}

}  // namespace
}  // namespace gantry
