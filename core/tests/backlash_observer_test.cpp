// The backlash observer against a load behind a gap that is integrated here, and what it must not learn from.
#include <gtest/gtest.h>

#include <limits>

#include "core/control/compensated_law.hpp"
#include "example.hpp"

namespace gantry {
namespace {

using Params = CompensationParams<double>;
using State = CompensationState<double>;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kPi = 3.14159265358979323846;
using example::kMm, example::kRatio, example::kTs;

Params observed() {
  Params p = example::observed();
  p.backlash_observer = true;
  p.backlash_memory = std::exp(-kTs / 300.0);
  p.backlash_fast = 1.0 - std::exp(-kTs * 4.0 * p.swing_rad_s);
  p.backlash_slow = 1.0 - std::exp(-kTs * p.swing_rad_s / 4.0);
  return p;
}

// A load behind a gap, and the torque of a motor that goes as it should.
struct Machine {
  double backlash = 0.0, softer = 1.0, friction = 6e3, friction_motor = 6e3;
  double load = 0.0, vel = 0.0, torque = 0.0;

  void scan(const Params& p, double x, double vel_motor, double acc_motor) {
    const double k = p.inertia_load_kg_m2 / p.windup_per_acc_s2 / softer, h = kTs / 20.0;
    for (int n = 0; n < 20; ++n) {
      const double twist = x + (n - 20) * h * vel_motor - load;
      const double wound = twist > 0.5 * backlash    ? twist - 0.5 * backlash
                           : twist < -0.5 * backlash ? twist + 0.5 * backlash
                                                     : 0.0;
      torque = wound == 0.0 ? 0.0 : k * wound + 1.4e6 * (vel_motor - vel);
      if (torque * wound < 0.0) torque = 0.0;
      const double before = vel + h / p.inertia_load_kg_m2 * (torque - p.moment_sine_nm * std::sin(load));
      const double most = h / p.inertia_load_kg_m2 * friction;
      vel = std::fabs(before) < most ? 0.0 : before - std::copysign(most, before);
      load += h * vel;
    }
    const double z = vel_motor == 0.0 ? 0.0 : std::copysign(1.0, vel_motor);
    const double rubs = z * (friction_motor + p.friction_load_ratio * std::fabs(torque));
    torque = (torque + (p.inertia_kg_m2 - p.inertia_load_kg_m2) * acc_motor + rubs) / kRatio;
  }
};

// Moves of 14 s without a step of the acceleration, with 2 s of rest; returns the backlash seen at the end.
double moves(const Params& p, State& s, Machine& m, std::initializer_list<double> places,
             double spoil = 0.0) {
  double at = *places.begin(), seen = 0.0;
  bool going = s.started;
  for (const double to : places) {
    for (int k = 0; k < 16000; ++k) {
      const double part = std::min(1.0, k / 14000.0), way = to - at;
      const double pos = at + way * (part - std::sin(2.0 * kPi * part) / (2.0 * kPi));
      const double vel = part < 1.0 ? way / 14.0 * (1.0 - std::cos(2.0 * kPi * part)) : 0.0;
      const double acc = part < 1.0 ? way * 2.0 * kPi / 196.0 * std::sin(2.0 * kPi * part) : 0.0;
      m.scan(p, pos, vel, acc);
      const double torque = spoil != 0.0 && k % 100 == 0 ? spoil : m.torque;
      seen = observe_backlash(p, kRatio, {pos, vel, acc}, pos, torque, going, s);
      going = true;
    }
    at = to;
  }
  s.started = true;
  return seen;
}

const std::initializer_list<double> kThere{0.0, 0.35, 0.0, -0.35, 0.0, 0.35, 0.0};

TEST(BacklashObserver, finds_what_the_gap_is_within_a_step_of_the_bank) {
  const Params p = observed();
  for (const double gap : {0.0, 0.05, 0.12, 0.2, 0.3}) {
    State s;
    Machine m;
    m.backlash = gap * kMm;
    EXPECT_NEAR(moves(p, s, m, kThere) / kMm, gap, 0.02) << gap;
    // What is in use has followed: beside what the calibration holds.
    EXPECT_NEAR(s.backlash_change_rad / kMm, gap - 0.05, 0.03) << gap;
  }
}

TEST(BacklashObserver, is_not_deceived_by_a_softer_gear_or_other_friction_of_the_motor) {
  const Params p = observed();
  for (const double gap : {0.05, 0.2}) {
    State s, t;
    Machine softer, rubs;
    softer.backlash = rubs.backlash = gap * kMm;
    softer.softer = 1.1;
    rubs.friction_motor = 8e3;
    EXPECT_NEAR(moves(p, s, softer, kThere) / kMm, gap, 0.05);
    EXPECT_NEAR(moves(p, t, rubs, kThere) / kMm, gap, 0.05);
  }
}

TEST(BacklashObserver, follows_no_more_than_its_bank) {
  const Params p = observed();
  State s;
  Machine m;
  m.backlash = 0.8 * kMm;
  EXPECT_LE(moves(p, s, m, kThere), 7.0 * p.backlash_step_rad);
  EXPECT_LE(s.backlash_change_rad, 7.0 * p.backlash_step_rad - p.backlash_held_rad);
}

TEST(BacklashObserver, learns_nothing_at_rest_or_without_a_torque) {
  const Params p = observed();
  State s;
  for (int k = 0; k < 5000; ++k)
    observe_backlash(p, kRatio, {0.3, 0.0, 0.0}, 0.3, k % 2 == 0 ? 40.0 : -40.0, k > 0, s);
  EXPECT_EQ(s.bank[3].misfit, 0.0);
  EXPECT_EQ(s.backlash_change_rad, 0.0);
  State t;
  for (int k = 0; k < 5000; ++k) observe_backlash(p, kRatio, {1e-4 * k, 0.1, 0.0}, 1e-4 * k, kNaN, k > 0, t);
  EXPECT_EQ(t.bank[3].misfit, 0.0);
  EXPECT_EQ(t.backlash_change_rad, 0.0);
  // Angles of NaN, and one that comes back a scan later.
  for (int k = 0; k < 10; ++k)
    observe_backlash(p, kRatio, {0.5 + 1e-4 * k, 0.1, 0.0}, k < 9 ? kNaN : 0.501, 20.0, true, t);
  EXPECT_TRUE(std::isfinite(t.motor_last_rad) && std::isfinite(t.bank[3].twist_rad));
}

TEST(BacklashObserver, bears_a_torque_that_is_missing_now_and_then) {
  const Params p = observed();
  State s;
  Machine m;
  m.backlash = 0.2 * kMm;
  EXPECT_NEAR(moves(p, s, m, kThere, kNaN) / kMm, 0.2, 0.02);
}

// Of the law only what it is for changes: with a bank that says what the calibration holds, no bit does.
TEST(BacklashObserver, plans_with_what_it_found) {
  Params p = observed();
  p.reversal = true;
  p.pos_limit_rad = 1e-3;
  State s;
  s.direction = 1.0;
  EXPECT_EQ(flank_now(p, s).backlash_rad, 0.0);
  EXPECT_EQ(flank_now(p, s).friction_nm, 6e3);
  s.backlash_change_rad = 0.15 * kMm;
  s.friction_change_nm = -3.6e3;
  EXPECT_DOUBLE_EQ(flank_now(p, s).backlash_rad, 0.15 * kMm);
  EXPECT_DOUBLE_EQ(flank_now(p, s).friction_nm, 4.2e3);
  EXPECT_DOUBLE_EQ(flank_now(p, s).gone_nm, 1.8e3);
  const Moment<double> none{0.0, 0.0};
  EXPECT_NEAR(map_correction(p, none, flank_now(p, s), 1.0, 0.0, 0.0, 0.0, 0.0, 0.0).pos, 0.075 * kMm, 1e-18);
  EXPECT_NEAR(map_correction(p, none, flank_now(p, s), -1.0, 0.0, 0.0, 0.0, 0.0, 0.0).pos, -0.075 * kMm,
              1e-18);
  p.flank_friction_share = 0.5;
  EXPECT_DOUBLE_EQ(flank_now(p, s).friction_nm, 2.1e3);
  EXPECT_DOUBLE_EQ(friction_load_now(p, s), 4.2e3);
  EXPECT_DOUBLE_EQ(flank_now(p, s).gone_nm, 1.8e3);
  s.friction_change_nm = 3.6e3;
  EXPECT_EQ(flank_now(p, s).gone_nm, 0.0);
  s.friction_change_nm = -3.6e3;
  p.flank_friction_share = 1.0;
  p.backlash_observer = false;
  EXPECT_EQ(flank_now(p, s).backlash_rad, 0.0);
  EXPECT_EQ(flank_now(p, s).friction_nm, 6e3);
  EXPECT_EQ(flank_now(p, s).gone_nm, 0.0);
}

TEST(BacklashObserver, packs_give_each_lane_the_bits_that_it_has_alone) {
  constexpr int kLanes = 4;
  const Params p = observed();
  const CompensationParams<Pack<kLanes>> many = example::in_every_lane<kLanes>(p);
  CompensationState<Pack<kLanes>> states;
  State alone[kLanes];
  for (int scan = 0; scan < 400; ++scan) {
    const double pos = 0.2 + 1e-4 * scan;
    Pack<kLanes> torque;
    for (int k = 0; k < kLanes; ++k) torque.lane[k] = k == 3 ? kNaN : 20.0 + 9.0 * k * std::sin(0.02 * scan);
    const auto seen = observe_backlash(many, Pack<kLanes>(kRatio),
                                       {Pack<kLanes>(pos), Pack<kLanes>(0.1), Pack<kLanes>(0.0)},
                                       Pack<kLanes>(pos), torque, mask<Pack<kLanes>>(scan > 0), states);
    for (int k = 0; k < kLanes; ++k) {
      const double one =
          observe_backlash(p, kRatio, {pos, 0.1, 0.0}, pos, torque.lane[k], scan > 0, alone[k]);
      EXPECT_EQ(seen.lane[k], one);
      EXPECT_EQ(states.backlash_change_rad.lane[k], alone[k].backlash_change_rad);
      EXPECT_EQ(states.bank[5].misfit.lane[k], alone[k].bank[5].misfit);
    }
  }
}

}  // namespace
}  // namespace gantry
