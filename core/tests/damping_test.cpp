// How the motor yields to a load that swings.
#include <gtest/gtest.h>

#include "core/control/compensated_law.hpp"
#include "example.hpp"

namespace gantry {
namespace {

using Params = CompensationParams<double>;
using State = CompensationState<double>;

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
    EXPECT_NEAR(unplanned_twist(p, example::calibrated(p), example::flank(p), 0.0, r, side * 1e-4),
                side * 1.52e-5, 1e-18);
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
    const double windup = windup_correction(p, example::calibrated(p), r.pos, r.vel, r.acc, jerk).pos;
    const double counts = (r.pos + windup) * law.ratio / law.rad_per_count;
    const double apart = compensated_law(law, p, s, r, counts, r.pos, 0.0).law.vel_cmd_rad_s -
                         compensated_law(law, stiff, without, r, counts, r.pos, 0.0).law.vel_cmd_rad_s;
    // Kpp x gain x half a scan of the acceleration; the wind-up taken for a swing would be 5e-4 rad/s in the
    // end.
    EXPECT_NEAR(apart / law.ratio, 0.0, 4e-6);
  }
}

}  // namespace
}  // namespace gantry
