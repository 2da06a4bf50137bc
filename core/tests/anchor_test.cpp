// Waves continued from an anchor for a millisecond, against the same waves evaluated in full: one by one, and
// in what they do to a whole move.
#include <gtest/gtest.h>

#include "core/loop/closed_loop.hpp"
#include "example.hpp"

namespace gantry {
namespace {

constexpr double kDegrees = 57.29577951308232;

// 10 deg at 6 deg/s, then rest.
constexpr double kWay = 10.0 / kDegrees, kSpeed = 6.0 / kDegrees, kAcc = 8.0 / kDegrees;
constexpr std::size_t kScans = 4000;

Segments move() {
  const double ramp = kSpeed / kAcc, end = kWay / kSpeed;
  return {{{0.0, 0.0, 0.0, kAcc, 0.0},
           {ramp, 0.5 * kAcc * ramp * ramp, kSpeed, 0.0, 0.0},
           {end, kWay - 0.5 * kAcc * ramp * ramp, kSpeed, -kAcc, 0.0}},
          end + ramp,
          kWay,
          0.0};
}

struct Setting {
  bool ideal_encoder = true;
  double anchor_period_s = 1e-3;  // one drive cycle: everything in full, as often as can be (S9)
  int scan_ms = 1;
  double shift_rad = 0.0;  // of the start
};

// Load angle at the end of every millisecond and largest motor angle per scan.
std::vector<double> load_angles(const Setting& run) {
  DriveParams<double> drive = example::drive();
  if (run.ideal_encoder) drive.speed_count_rad = drive.position_count_rad = 0.0;
  GantrySim<double> sim(
      example::plant(), drive, 1200.0, 800.0,
      {1e-3 * run.scan_ms, example::kCycle, 8 * run.scan_ms, Scheme::kOneEvaluation, 2, run.anchor_period_s});
  sim.static_start(0.0, true);
  const PositionLawParams<double> law = example::law();
  const double counts = sim.counts(law.rad_per_count);
  const Control<double> control{law, run.ideal_encoder ? counts : std::round(counts)};
  sim.static_start(run.shift_rad, true);
  std::vector<double> angles;
  for (std::size_t k = 0; k < kScans / static_cast<std::size_t>(run.scan_ms); ++k) {
    closed_loop_scan(sim, control, move().sample(static_cast<double>(k) * sim.scan_period_s()));
    angles.push_back(sim.x.pos_load);
  }
  return angles;
}

double largest_difference_deg(const Setting& a, const Setting& b) {
  const std::vector<double> one = load_angles(a), other = load_angles(b);
  double largest = 0.0;
  for (std::size_t k = 0; k < one.size(); ++k) largest = std::max(largest, std::fabs(one[k] - other[k]));
  return largest * kDegrees;
}

TEST(Anchor, moves_an_axis_with_an_ideal_encoder_by_less_than_1e_9_deg) {
  for (int scan_ms : {1, 4}) {
    const double moved =
        largest_difference_deg({true, 1e-3, scan_ms, 0.0}, {true, example::kCycle, scan_ms, 0.0});
    RecordProperty("deg_" + std::to_string(scan_ms) + "_ms", std::to_string(moved * 1e12) + "e-12");
    EXPECT_LT(moved, 1e-9) << scan_ms;
    EXPECT_GT(moved, 0.0) << scan_ms;
  }
}

// An encoder in steps makes of the smallest difference one step sooner or later: no more than this may
// remain.
TEST(Anchor, moves_an_axis_with_a_counting_encoder_no_more_than_a_start_moved_by_1e_13_rad) {
  const Setting full{false, example::kCycle, 1, 0.0};
  const double moved = largest_difference_deg({false, 1e-3, 1, 0.0}, full);
  double shifted = 0.0;
  for (double shift : {1e-13, -1e-13, 0.7e-13, -0.4e-13})
    shifted = std::max(shifted, largest_difference_deg({false, example::kCycle, 1, shift}, full));
  EXPECT_LT(moved, 1.5 * shifted);
  EXPECT_LT(moved, 1e-6);  // and both are nothing beside 0.02 deg
}

TEST(Anchor, waves_of_the_motor_are_those_in_full_within_their_reach) {
  const PlantParams<double> p = example::plant();
  const Plant<double> plant(p);
  for (double way : {-1.0, -0.5, -0.13, 0.0, 0.02, 0.13, 0.49, 5.0, 1000.0}) {
    MotorWaves<double> waves(plant.gear, 77.3);
    const double pos = 77.3 + way;
    const MotorSide<double> side = motor_side(plant, plant.gear, waves, pos);
    const ErrorValue<double> full = plant.gear.motor_error(pos);
    EXPECT_NEAR(side.error.error, full.error, 3e-12) << way;
    EXPECT_NEAR(side.error.slope, full.slope, 3e-12) << way;
    EXPECT_NEAR(side.ripple, std::sin(12 * pos), 3e-6) << way;
    EXPECT_EQ(waves.pos, std::fabs(way) > 0.5 ? pos : 77.3) << way;  // begun anew where it has left the reach
    if (std::fabs(way) < 0.14) {                                     // one millisecond at full speed
      EXPECT_NEAR(side.error.error, full.error, 1e-16) << way;
      EXPECT_NEAR(side.ripple, std::sin(12 * pos), 1e-10) << way;
    }
  }
}

// Of two motors side by side the one that has left the reach of 0.03 rad.
TEST(Anchor, waves_begin_anew_where_a_motor_has_left_their_reach) {
  using Two = Pack<2>;
  const GearError<Two> gear{PlantParams<Two>()};
  MotorWaves<Two> waves(gear, Two(1.0));
  Two pos(1.01);
  set_lane(pos, 1, 2.0);
  waves.reach(gear, pos);
  EXPECT_EQ(lane(waves.pos, 0), 1.0);
  EXPECT_EQ(lane(waves.pos, 1), 2.0);
}

TEST(Anchor, eccentric_torque_is_that_in_full_near_its_anchor) {
  PlantParams<double> p = example::plant();
  p.eccentric_angle_rad = 0.4;
  const EccentricTorque<double> torque(p, 1.1);
  for (double way : {-1e-3, 0.0, 1e-4, 1e-3})
    EXPECT_NEAR(torque(1.1 + way), p.eccentric_moment_nm * std::sin(0.7 + way), 1e-9) << way;
}

}  // namespace
}  // namespace gantry
