// The holding brake: its dead times, counted in drive cycles, and what a changed mind does to them.
#include <gtest/gtest.h>

#include "example.hpp"

namespace gantry {
namespace {

constexpr int kCyclesPerScan = 8;

// Drive cycles that pass with the old state from the command on, before the new one acts.
int cycles_until(Brake<double> brake, bool open, int close_cycles, int open_cycles) {
  const bool before = brake.closed;
  for (int k = 0; k < 100000; ++k) {
    if (k % kCyclesPerScan == 0 && brake.command(open, close_cycles, open_cycles)) return k;
    EXPECT_EQ(brake.closed, before);
    if (brake.cycle()) return k + 1;
  }
  return -1;
}

TEST(Brake, is_closed_before_any_command) {
  EXPECT_TRUE(Brake<double>().closed);
  EXPECT_EQ(Brake<double>().countdown, 0.0);
}

TEST(Brake, closes_after_exactly_its_dead_time) {
  const Brake<double> open{false, 0};
  EXPECT_EQ(cycles_until(open, false, 1200, 800), 1200);
  for (int cycles : {1, 7, 8, 9, 1195}) EXPECT_EQ(cycles_until(open, false, cycles, 800), cycles);
  EXPECT_EQ(cycles_until(open, false, 0, 800), 0);
}

TEST(Brake, opens_after_exactly_its_dead_time) {
  const Brake<double> closed{true, 0};
  EXPECT_EQ(cycles_until(closed, true, 1200, 800), 800);
  EXPECT_EQ(cycles_until(closed, true, 1200, 0), 0);
}

TEST(Brake, without_a_dead_time_follows_at_once) {
  Brake<double> brake{false, 0};
  EXPECT_TRUE(brake.command(false, 0.0, 0.0));
  EXPECT_TRUE(brake.closed);
  EXPECT_TRUE(brake.command(true, 0.0, 0.0));
  EXPECT_FALSE(brake.closed);
}

TEST(Brake, stays_where_it_is_commanded) {
  EXPECT_EQ(cycles_until(Brake<double>{true, 0}, false, 5, 5), -1);
  EXPECT_EQ(cycles_until(Brake<double>{false, 0}, true, 5, 5), -1);
}

TEST(Brake, a_command_taken_back_starts_the_dead_time_anew) {
  Brake<double> brake{false, 0};
  brake.command(false, 1200, 800);
  for (int k = 0; k < 1199; ++k) brake.cycle();
  EXPECT_FALSE(brake.command(true, 1200, 800));
  EXPECT_FALSE(brake.cycle());
  EXPECT_FALSE(brake.closed);
  EXPECT_EQ(cycles_until(brake, false, 1200, 800), 1200);
}

TEST(Brake, a_closing_brake_can_open_again) {
  Brake<double> brake{false, 0};
  brake.command(false, 1200, 800);
  for (int k = 0; k < 1200; ++k) brake.cycle();
  EXPECT_TRUE(brake.closed);
  EXPECT_EQ(cycles_until(brake, true, 1200, 800), 800);
}

TEST(Brake, of_a_simulator_holds_from_the_end_of_its_dead_time) {
  GantrySim<double> sim = example::sim();
  sim.static_start(0.5, true);
  for (int k = 0; k < 150; ++k) {
    EXPECT_FALSE(sim.brake.closed) << "scan " << k;
    EXPECT_EQ(sim.x.brake_z, 0.0);
    sim.scan({DriveMode::kSpeed, 0.1, 0.0}, false);
  }
  EXPECT_TRUE(sim.brake.closed);
  EXPECT_EQ(sim.x.brake_z, 0.0);
  sim.scan({DriveMode::kSpeed, 0.1, 0.0}, false);
  EXPECT_NE(sim.x.brake_z, 0.0);
}

TEST(Brake, opened_forgets_its_spring) {
  GantrySim<double> sim = example::sim();
  sim.static_start(0.5, false);
  EXPECT_NE(sim.x.brake_z, 0.0);
  for (int k = 0; k < 100; ++k) {
    EXPECT_TRUE(sim.brake.closed) << "scan " << k;
    sim.scan({DriveMode::kOff, 0.0, 0.0}, true);
  }
  EXPECT_FALSE(sim.brake.closed);
  EXPECT_EQ(sim.x.brake_z, 0.0);
}

TEST(Brake, opened_on_a_turning_shaft_forgets_its_spring_too) {
  GantrySim<double> sim(example::plant(), example::drive(), 0.0, 0.0,
                        {1e-3, example::kCycle, 8, Scheme::kOneEvaluation, 2});
  sim.static_start(0.0, false);
  sim.x.vel_motor = 120.0;
  sim.scan({DriveMode::kOff, 0.0, 0.0}, true);
  EXPECT_EQ(sim.x.brake_z, 0.0);
}

TEST(Brake, closing_on_a_turning_shaft_slips_at_once) {
  for (double vel : {120.0, -120.0}) {
    GantrySim<double> sim = example::sim();
    sim.static_start(0.0, true);
    sim.x.vel_motor = vel;
    sim.x.vel_load = vel / example::kRatio;
    for (int k = 0; k < 150; ++k) sim.scan({DriveMode::kOff, 0.0, 0.0}, false);
    ASSERT_TRUE(sim.brake.closed);
    EXPECT_EQ(sim.x.brake_z, std::copysign(5e-4, vel));
  }
}

}  // namespace
}  // namespace gantry
