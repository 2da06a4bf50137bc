// Many plants through many legs: any number of threads, the same bits; and the same as scan by scan.
#include <gtest/gtest.h>

#include <cstring>

#include "core/loop/closed_loop.hpp"
#include "example.hpp"

namespace gantry {
namespace {

constexpr double kAcc = 0.0069;

std::vector<GantrySim<double>> plants(std::size_t n) {
  std::mt19937 random(21);
  std::vector<GantrySim<double>> sims;
  for (std::size_t k = 0; k < n; ++k) {
    sims.push_back(example::sim(example::varied(example::plant(), random), example::drive()));
    sims.back().static_start(0.1 * static_cast<double>(k), true);
  }
  return sims;
}

std::vector<Leg> legs() {
  return {{example::triangle(0.0, 0.0002, kAcc), 400, 50},
          {example::triangle(0.0002, -0.0003, kAcc), 300, 1}};
}

std::vector<std::vector<LegResult>> run(int threads, std::size_t n) {
  std::vector<GantrySim<double>> sims = plants(n);
  std::vector<GantrySim<double>*> pointers;
  std::vector<Control> controls;
  for (GantrySim<double>& sim : sims) {
    pointers.push_back(&sim);
    controls.push_back({example::law(), std::round(sim.counts(example::kFineCount))});
  }
  return run_legs(pointers, controls, legs(), threads);
}

void expect_same(const std::vector<std::vector<LegResult>>& a, const std::vector<std::vector<LegResult>>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t n = 0; n < a.size(); ++n) {
    ASSERT_EQ(a[n].size(), b[n].size());
    for (std::size_t k = 0; k < a[n].size(); ++k)
      EXPECT_EQ(std::memcmp(&a[n][k], &b[n][k], sizeof(LegResult)), 0) << "plant " << n << ", leg " << k;
  }
}

TEST(RunLegs, does_not_depend_on_the_number_of_threads) {
  const auto one = run(1, 5);
  EXPECT_NE(one[0][0].max_torque_motor_nm, one[1][0].max_torque_motor_nm);
  for (int threads : {2, 3, 5, 16}) expect_same(one, run(threads, 5));
}

TEST(RunLegs, without_plants_returns_nothing) { EXPECT_TRUE(run(4, 0).empty()); }

TEST(RunLegs, results_are_those_of_the_logged_rows) {
  GantrySim<double> sim = plants(1)[0];
  const double zero = std::round(sim.counts(example::kFineCount));
  GantrySim<double> again = sim;
  const Leg leg = legs()[0];
  const LegResult result = run_leg(sim, {example::law(), zero}, leg);
  double largest_error = 0.0, largest_torque = 0.0, mean = 0.0;
  run_plan(again, {example::law(), zero}, leg.plan, leg.scans, [&](long k, const LogRow& row) {
    largest_error = std::max(largest_error, std::fabs(row.vel_load_rad_s - row.vel_ref_rad_s));
    largest_torque = std::max(largest_torque, std::fabs(row.torque_mesh_nm));
    if (k >= leg.scans - leg.average) mean += row.pos_load_rad / static_cast<double>(leg.average);
  });
  EXPECT_EQ(result.max_vel_err_load_rad_s, largest_error);
  EXPECT_EQ(result.max_torque_mesh_nm, largest_torque);
  EXPECT_NEAR(result.mean_pos_load_rad, mean, 1e-16);
  EXPECT_EQ(sim.x.pos_load, again.x.pos_load);
}

TEST(RunPlan, is_scan_after_scan_of_the_same_functions) {
  GantrySim<double> sim = plants(1)[0], by_hand = sim;
  const double zero = std::round(sim.counts(example::kFineCount));
  const PositionLawParams law = example::law();
  const Segments plan = example::triangle(0.0, 0.0002, kAcc);
  run_plan(sim, {law, zero}, plan, 300, [&](long k, const LogRow& row) {
    const SetPoint r = plan.sample(static_cast<double>(k) * 1e-3);
    const auto c = position_law(law, r.pos, r.vel, by_hand.counts(law.rad_per_count) - zero);
    EXPECT_EQ(row.pos_ref_rad, r.pos);
    EXPECT_EQ(row.vel_cmd_rad_s, c.vel_cmd_rad_s);
    EXPECT_EQ(row.pos_load_rad, by_hand.x.pos_load);
    by_hand.scan({DriveMode::kSpeed, c.vel_cmd_rad_s, 0.0}, true);
  });
  EXPECT_EQ(sim.x.pos_load, by_hand.x.pos_load);
  EXPECT_EQ(sim.s.integral, by_hand.s.integral);
}

}  // namespace
}  // namespace gantry
