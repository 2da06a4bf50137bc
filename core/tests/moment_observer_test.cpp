// The moment observer against a torque balance written here, and what keeps it within its limits.
#include <gtest/gtest.h>

#include <limits>

#include "core/control/compensated_law.hpp"
#include "example.hpp"

namespace gantry {
namespace {

using Params = CompensationParams<double>;
using State = CompensationState<double>;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
using example::kRatio, example::kTs;

Params observed() {
  Params p = example::observed();
  p.moment_cosine_nm = -1e3;
  p.friction_nm_s_per_rad = 6e4;
  p.observer_rate = 1e-3;
  return p;
}

// What a machine is that has changed.
struct Machine {
  double sine = 0.0, cosine = 0.0, friction = 0.0;

  double torque(const Params& p, double pos, double vel) const {
    const double moment =
        (p.moment_sine_nm + sine) * std::sin(pos) + (p.moment_cosine_nm + cosine) * std::cos(pos);
    const double lost = p.friction_nm + friction + p.friction_load_ratio * std::fabs(moment);
    return (moment + p.friction_nm_s_per_rad * vel + std::copysign(lost, vel)) / kRatio;
  }
};

// Moves from one angle to another at constant speed; returns what is seen at the end.
Moment<double> move(const Params& p, State& s, const Machine& machine, double from, double to, double speed) {
  const double vel = std::copysign(speed, to - from);
  s.direction = std::copysign(1.0, vel);
  Moment<double> seen{0.0, 0.0};
  const int scans = static_cast<int>(std::fabs(to - from) / (speed * kTs));
  for (int k = 0; k < scans; ++k) {
    const double pos = from + k * kTs * vel;
    seen = observe_moment(p, kRatio, {pos, vel, 0.0}, machine.torque(p, pos, vel), s);
  }
  return seen;
}

TEST(MomentObserver, tells_moment_from_friction_by_motion_both_ways) {
  const Params p = observed();
  for (const Machine& machine : {Machine{2e4, 0.0, 0.0}, Machine{-8e3, 5e3, 4e3}, Machine{0.0, 0.0, -4e3}}) {
    State s;
    move(p, s, machine, -1.5, 1.5, 0.1);
    const Moment<double> seen = move(p, s, machine, 1.5, -1.5, 0.1);
    // The prior keeps one part in some hundred, the load ratio lags behind the moment in use by as much.
    EXPECT_NEAR(seen.sine_nm, machine.sine, 0.02 * 2e4);
    EXPECT_NEAR(seen.cosine_nm, machine.cosine, 0.02 * 2e4);
    // What is in use has followed.
    EXPECT_NEAR(moment_now(p, s).sine_nm, p.moment_sine_nm + seen.sine_nm, 200.0);
  }
}

TEST(MomentObserver, uses_no_more_than_its_limit_and_tells_what_it_sees) {
  Params p = observed();
  p.moment_limit_nm = 5e3;
  State s;
  move(p, s, {2e4, 0.0, 0.0}, -1.5, 1.5, 0.1);
  const Moment<double> seen = move(p, s, {2e4, 0.0, 0.0}, 1.5, -1.5, 0.1);
  EXPECT_GT(seen.sine_nm, 1.5e4);
  EXPECT_NEAR(std::hypot(s.moment_sine_nm, s.moment_cosine_nm), p.moment_limit_nm, 10.0);
  EXPECT_LE(std::hypot(s.moment_sine_nm, s.moment_cosine_nm), p.moment_limit_nm);
}

TEST(MomentObserver, learns_nothing_at_rest_in_reversal_or_without_a_torque) {
  const Params p = observed();
  State s;
  s.direction = 1.0;
  for (int k = 0; k < 1000; ++k) {
    observe_moment(p, kRatio, {1.0, 0.0, 0.0}, 100.0, s);
    observe_moment(p, kRatio, {1.0, 5e-4, 0.0}, 100.0, s);   // too slow
    observe_moment(p, kRatio, {1.0, -0.05, 0.0}, 100.0, s);  // the direction has not turned round
    observe_moment(p, kRatio, {1.0, 0.05, 0.0}, kNaN, s);
    observe_moment(p, kRatio, {1.0, 0.05, 0.0}, std::numeric_limits<double>::infinity(), s);
    observe_moment(p, kRatio, {1.0, 0.05, 0.0}, -std::numeric_limits<double>::infinity(), s);
  }
  EXPECT_EQ(s.info_friction, 0.0);
  EXPECT_EQ(s.moment_sine_nm, 0.0);
  EXPECT_EQ(moment_now(p, s).sine_nm, p.moment_sine_nm);
}

TEST(MomentObserver, learns_nothing_while_the_load_swings_out) {
  const Params p = observed();
  State s;
  s.direction = 1.0;
  s.swings_s = 1e-3;
  observe_moment(p, kRatio, {1.0, 0.05, 0.0}, 100.0, s);
  EXPECT_EQ(s.info_friction, 0.0);
  s.swings_s = 0.0;
  observe_moment(p, kRatio, {1.0, 0.05, 0.0}, 100.0, s);
  EXPECT_GT(s.info_friction, 0.0);
}

// Limit 10 kN m. Sums of 3e-8 of the sine and the prior of 1e-8: a sine as large as the limit is two standard
// deviations, at the limit. Where friction explains all of it but the prior, it is one; of a cosine nothing
// is known, and of both together the half.
TEST(MomentObserver, tells_a_change_of_two_standard_deviations) {
  Params p;
  p.moment_limit_nm = 1e4;
  p.friction_spread_nm = 1.0;
  State s;
  s.info_sine = 3.001e-8;
  EXPECT_TRUE(moment_resolved(p, s, {2e4, 0.0}));
  EXPECT_TRUE(moment_resolved(p, s, {-10.0, 0.0}));
  EXPECT_FALSE(moment_resolved(p, s, {0.0, 2e4}));
  EXPECT_FALSE(moment_resolved(p, s, {2e4, 2e4}));
  s.info_sine_cosine = 1.2e-8;  // (4 + 2 x 1.2 + 1)/2 of what one must be at least 4
  EXPECT_FALSE(moment_resolved(p, s, {2e4, 2e4}));
  s.info_sine_cosine = 1.6e-8;
  EXPECT_TRUE(moment_resolved(p, s, {2e4, 2e4}));
  EXPECT_FALSE(moment_resolved(p, s, {2e4, -2e4}));
  s = State();
  s.info_sine = 2.999e-8;
  EXPECT_FALSE(moment_resolved(p, s, {2e4, 0.0}));
  s.info_sine = s.info_friction = s.info_sine_friction = 1e-4;
  p.friction_spread_nm = 1e9;
  EXPECT_FALSE(moment_resolved(p, s, {2e4, 0.0}));
}

// Limit 5 kN m, a thousandth of the way in a scan: of (6, 8) kN m, 10 kN m in all, the half is followed.
TEST(MomentObserver, goes_a_part_of_the_way_in_each_scan_and_none_where_it_does_not_follow) {
  Params p = observed();
  p.moment_limit_nm = 5e3;
  State s;
  use_moment(p, {4e3, 0.0}, true, s);
  EXPECT_NEAR(s.moment_sine_nm, 4.0, 1e-12);
  use_moment(p, {4e3, 0.0}, true, s);
  EXPECT_NEAR(s.moment_sine_nm, 7.996, 1e-12);
  s = State();
  use_moment(p, {6e3, -8e3}, true, s);
  EXPECT_NEAR(s.moment_sine_nm, 3.0, 1e-12);
  EXPECT_NEAR(s.moment_cosine_nm, -4.0, 1e-12);
  const State before = s;
  use_moment(p, {6e3, -8e3}, false, s);
  EXPECT_EQ(s.moment_sine_nm, before.moment_sine_nm);
  EXPECT_EQ(s.moment_cosine_nm, before.moment_cosine_nm);
}

// Ratio 10, moment 1000 N m, 200 kg m2 at 0.5 rad/s2, 300 N m s/rad at 0.2 rad/s, friction of 50 N m and a
// tenth of the 1100 N m transmitted: 1320 N m are known. 142 N m of the motor are 1420: 100 are left over,
// for moment and friction alike.
TEST(MomentObserver, adds_what_is_left_of_the_torque_to_its_sums) {
  Params p;
  p.moment_observer = true;
  p.moment_sine_nm = 1000.0;
  p.inertia_kg_m2 = 200.0;
  p.friction_nm = 50.0;
  p.friction_load_ratio = 0.1;
  p.friction_nm_s_per_rad = 300.0;
  p.observer_speed_rad_s = 0.1;
  p.observer_weight = 2.0;
  p.observer_memory = 0.5;
  const double quarter = 1.570796326794896619;
  for (double side : {1.0, -1.0}) {
    State s;
    s.direction = side;
    // Half of what was there before is left.
    s.info_sine = s.info_cosine = s.info_friction = s.seen_sine = s.seen_cosine = s.seen_friction = 8.0;
    s.info_sine_cosine = s.info_sine_friction = s.info_cosine_friction = 8.0;
    observe_moment(p, 10.0, {side * quarter, side * 0.2, side * 0.5}, side * 142.0, s);
    EXPECT_NEAR(s.seen_friction, 4.0 + 200.0, 1e-9);
    EXPECT_NEAR(s.seen_sine, 4.0 + 200.0, 1e-9);
    EXPECT_NEAR(s.seen_cosine, 4.0, 1e-9);
    EXPECT_NEAR(s.info_sine, 4.0 + 2.0, 1e-12);
    EXPECT_NEAR(s.info_friction, 4.0 + 2.0, 1e-12);
    EXPECT_NEAR(s.info_sine_friction, 4.0 + 2.0, 1e-12);
    EXPECT_NEAR(s.info_cosine, 4.0, 1e-12);
    EXPECT_NEAR(s.info_sine_cosine, 4.0, 1e-12);
    EXPECT_NEAR(s.info_cosine_friction, 4.0, 1e-12);
    // At rest nothing is forgotten.
    observe_moment(p, 10.0, {side * quarter, 0.0, 0.0}, side * 142.0, s);
    EXPECT_NEAR(s.info_sine, 6.0, 1e-12);
    EXPECT_NEAR(s.seen_friction, 204.0, 1e-9);
    // 200 N m more are in use: 1300 N m are transmitted, of which 130 rub; 80 of the 1420 N m are left over.
    State heavier;
    heavier.direction = side;
    heavier.moment_sine_nm = 200.0;
    observe_moment(p, 10.0, {side * quarter, side * 0.2, side * 0.5}, side * 142.0, heavier);
    EXPECT_NEAR(heavier.seen_friction, 2.0 * 80.0, 1e-9);
    // With 500 N m of the cosine at an eighth of a turn: 1060.66 N m of moment, 100 of acceleration, 60 of
    // speed, 50 + 116.07 of friction. 140 N m of the motor are 1400: 13.274 are left over.
    Params both = p;
    both.moment_cosine_nm = side * 500.0;
    State t;
    t.direction = side;
    observe_moment(both, 10.0, {side * quarter / 2.0, side * 0.2, side * 0.5}, side * 140.0, t);
    EXPECT_NEAR(t.seen_friction, 2.0 * 13.2738, 2e-4);
    EXPECT_NEAR(t.seen_cosine, side * 2.0 * 13.2738 * 0.7071068, 2e-4);
    EXPECT_NEAR(t.info_sine_cosine, side * 1.0, 1e-12);
    EXPECT_NEAR(t.info_cosine_friction, side * 1.4142136, 1e-6);
    EXPECT_NEAR(t.info_cosine, 1.0, 1e-12);
  }
}

// (4 1 2; 1 5 1; 2 1 6) (1 2 3) = (12 14 22), a quarter of the first two numbers of the diagonal and 4 of the
// third being the prior.
TEST(MomentObserver, solves_its_three_equations) {
  Params p;
  p.moment_limit_nm = 2.0;
  p.friction_spread_nm = 0.5;
  State s;
  s.info_sine = 3.75;
  s.info_cosine = 4.75;
  s.info_friction = 2.0;
  s.info_sine_cosine = 1.0;
  s.info_sine_friction = 2.0;
  s.info_cosine_friction = 1.0;
  s.seen_sine = 12.0;
  s.seen_cosine = 14.0;
  s.seen_friction = 22.0;
  const Moment<double> found = moment_change(p, s);
  EXPECT_NEAR(found.sine_nm, 1.0, 1e-12);
  EXPECT_NEAR(found.cosine_nm, 2.0, 1e-12);
  EXPECT_NEAR(friction_change(p, s), 3.0, 1e-12);
  EXPECT_EQ(size_of(Moment<double>{3.0, -4.0}), 5.0);
}

// Switched off nothing is learnt and no change is told; switched on both.
TEST(MomentObserver, acts_in_the_law_where_it_is_switched_on) {
  for (bool on : {false, true}) {
    Params p = observed();
    p.moment_observer = on;
    p.reversal_length_rad = 1e-6;
    State s;
    // Much was seen of the sine.
    s.info_sine = 1e-3;
    s.seen_sine = 1.0;
    double change = 0.0;
    for (int k = 0; k < 3; ++k) {
      const SetPoint<double> r{0.3 + 1e-4 * k, 0.1, 0.0};
      change = compensated_law(example::law(), p, s, r, 0.0, 0.0, 80.0).moment_change_nm;
    }
    EXPECT_EQ(s.info_friction > 0.0, on);
    EXPECT_EQ(change > 0.0, on);
    EXPECT_EQ(change == 0.0, !on);
  }
}

// Three scans at 0.3 rad have seen 80 N m of the motor, and tell moment and friction not apart.
TEST(MomentObserver, tells_nothing_of_what_a_few_scans_have_seen) {
  Params p = observed();
  p.moment_observer = true;
  p.reversal_length_rad = 1e-6;
  State s;
  for (int k = 0; k < 3; ++k) {
    const SetPoint<double> r{0.3 + 1e-4 * k, 0.1, 0.0};
    EXPECT_EQ(compensated_law(example::law(), p, s, r, 0.0, 0.0, 80.0).moment_change_nm, 0.0);
  }
  EXPECT_GT(s.seen_sine, 0.0);
}

// A standing axis must not creep after what it has learnt in motion.
TEST(MomentObserver, follows_nothing_at_rest_though_much_was_seen) {
  const Params p = observed();
  State s;
  move(p, s, {2e4, 8e3, 0.0}, -1.5, 1.5, 0.1);
  const double sine = s.moment_sine_nm, cosine = s.moment_cosine_nm;
  EXPECT_GT(std::fabs(sine) + std::fabs(cosine), 100.0);
  for (int k = 0; k < 100; ++k) observe_moment(p, kRatio, {1.0, 0.0, 0.0}, 50.0, s);
  EXPECT_EQ(s.moment_sine_nm, sine);
  EXPECT_EQ(s.moment_cosine_nm, cosine);
}

// What is in use is the calibration and its change, in both parts.
TEST(MomentObserver, adds_the_change_to_the_calibration) {
  const Params p = observed();
  State s;
  s.moment_sine_nm = 200.0;
  s.moment_cosine_nm = -300.0;
  EXPECT_EQ(moment_now(p, s).sine_nm, 16200.0);
  EXPECT_EQ(moment_now(p, s).cosine_nm, -1300.0);
}

TEST(MomentObserver, forgets_what_was_before) {
  Params p = observed();
  p.observer_memory = std::exp(-kTs / 20.0);
  State s;
  for (int k = 0; k < 2; ++k) {
    move(p, s, {2e4, 0.0, 0.0}, -1.5, 1.5, 0.1);
    move(p, s, {2e4, 0.0, 0.0}, 1.5, -1.5, 0.1);
  }
  Moment<double> seen{0.0, 0.0};
  for (int k = 0; k < 2; ++k) {
    move(p, s, {0.0, 0.0, 0.0}, -1.5, 1.5, 0.1);
    seen = move(p, s, {0.0, 0.0, 0.0}, 1.5, -1.5, 0.1);
  }
  EXPECT_NEAR(seen.sine_nm, 0.0, 500.0);
}

TEST(MomentObserver, switched_off_changes_no_bit_of_the_law) {
  Params off = observed();
  off.moment_observer = false;
  off.windup = off.torque_eccentric = true;
  off.compliance_rad_per_nm = 2.8e-9;
  off.pos_limit_rad = 1e-3;
  off.torque_limit_nm = 60.0;
  Params on = off;
  on.moment_observer = true;
  on.observer_weight = 0.0;
  State a, b;
  for (int k = 0; k < 100; ++k) {
    const SetPoint<double> r{0.3 + 1e-5 * k, 0.01, 0.0};
    const double counts = 0.3 * kRatio / example::law().rad_per_count;
    const auto x = compensated_law(example::law(), off, a, r, counts, 0.0, 80.0);
    const auto y = compensated_law(example::law(), on, b, r, counts, 0.0, 80.0);
    EXPECT_EQ(x.law.vel_cmd_rad_s, y.law.vel_cmd_rad_s);
    EXPECT_EQ(x.torque_ff_nm, y.torque_ff_nm);
  }
}

TEST(MomentObserver, packs_give_each_lane_the_bits_that_it_has_alone) {
  constexpr int kLanes = 4;
  const Params p = observed();
  const CompensationParams<Pack<kLanes>> many = example::in_every_lane<kLanes>(p);
  CompensationState<Pack<kLanes>> states;
  State alone[kLanes];
  states.direction = Pack<kLanes>(1.0);
  for (State& s : alone) s.direction = 1.0;
  for (int scan = 0; scan < 200; ++scan) {
    const double pos = 0.2 + 1e-4 * scan;
    Pack<kLanes> torque;
    for (int k = 0; k < kLanes; ++k) torque.lane[k] = k == 3 ? kNaN : 20.0 + 3.0 * k;
    const auto seen =
        observe_moment(many, Pack<kLanes>(kRatio), {Pack<kLanes>(pos), Pack<kLanes>(0.1), Pack<kLanes>(0.0)},
                       torque, states);
    for (int k = 0; k < kLanes; ++k) {
      const auto one = observe_moment(p, kRatio, {pos, 0.1, 0.0}, torque.lane[k], alone[k]);
      EXPECT_EQ(seen.sine_nm.lane[k], one.sine_nm);
      EXPECT_EQ(states.moment_cosine_nm.lane[k], alone[k].moment_cosine_nm);
    }
  }
}

}  // namespace
}  // namespace gantry
