// The backlash by an encoder on the ring: a motor that obeys, a load that lies on one flank or the other.
#include <gtest/gtest.h>

#include <cmath>
#include <initializer_list>
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

Params followed() {
  Params p = example::observed();
  p.backlash_observer = p.load_encoder = p.reversal = true;
  p.friction_load_ratio = 0.0;
  p.moment_limit_nm = 4e4;
  p.flank_nm = 1e3;
  p.reversal_length_rad = 1.7e-4;
  p.pos_limit_rad = p.encoder_limit_rad = 9e-4;
  p.encoder_gain_per_s = 1.0;
  p.swing_speed_max_rad_s = 0.017;
  p.backlash_memory = std::exp(-kTs / 100.0);
  return p;
}

PositionLawParams<double> law() { return {10.0, 1.0, kRatio, 1.0, 200.0}; }

// A motor that goes as it is told; a load behind a gap, loaded by a moment and friction of its own; 2 um of
// noise on the ring, which a generator of whole numbers gives.
struct Machine {
  double backlash = 0.0, moment = 1.6e4, friction = 6e3, windup = 0.0, torque_noise = 0.0;
  double motor = 0.0;
  unsigned number = 1;

  double ring(const SetPoint<double>& r, double z) {
    const double mesh = moment * std::sin(r.pos) + z * friction + 2.17e6 * r.acc;
    number = 1664525u * number + 1013904223u;
    const double noise = 1.7e-6 * (number / 2147483648.0 - 1.0);
    return motor - 0.5 * backlash * (mesh > 0.0 ? 1.0 : -1.0) - windup * mesh + noise;
  }
  double torque(const SetPoint<double>& r, double z) {
    number = 1664525u * number + 1013904223u;
    const double noise = torque_noise * 1.73 * (number / 2147483648.0 - 1.0);
    return noise +
           (moment * std::sin(r.pos) + 2.64e6 * r.acc + (r.vel != 0.0 ? z * 2.0 * friction : 0.0)) / kRatio;
  }
};

struct Seen {
  double speed_jump = 0.0;  // of the command in the scan after a change, rad/s of the motor
  int changes = 0;
};

// Moves of 14 s at constant speed with ramps of 1 s, with 2 s of rest.
Seen moves(const Params& p, State& s, Machine& m, std::initializer_list<double> places, double spoil = 0.0) {
  const PositionLawParams<double> l = law();
  double at = *places.begin(), z = 1.0, before = 0.0, change = s.backlash_change_rad;
  Seen seen;
  bool changed = false;
  for (const double to : places) {
    const double top = (to - at) / 13.0;
    for (int k = 0; k < 16000; ++k) {
      const double t = std::min(k * kTs, 14.0);
      SetPoint<double> r{to, 0.0, 0.0};
      if (t < 1.0)
        r = {at + 0.5 * top * t * t, top * t, top};
      else if (t < 13.0)
        r = {at + top * (t - 0.5), top, 0.0};
      else if (t < 14.0)
        r = {to - 0.5 * top * (14.0 - t) * (14.0 - t), top * (14.0 - t), -top};
      if (r.vel != 0.0) z = r.vel > 0.0 ? 1.0 : -1.0;
      const double ring = spoil != 0.0 && k % 50 == 0 ? spoil : m.ring(r, z);
      const auto out = compensated_law(l, p, s, r, m.motor * kRatio, ring, m.torque(r, z));
      if (changed) seen.speed_jump = std::max(seen.speed_jump, std::fabs(out.law.vel_cmd_rad_s - before));
      changed = s.backlash_change_rad != change;
      seen.changes += changed;
      EXPECT_TRUE(!changed || r.vel == 0.0);
      change = s.backlash_change_rad;
      before = out.law.vel_cmd_rad_s;
      m.motor += kTs * out.law.vel_cmd_rad_s / kRatio;
    }
    at = to;
  }
  return seen;
}

const std::initializer_list<double> kThere{0.0, 1.5, -1.5, 1.5, -1.5, 0.0};

TEST(LostMotion, finds_what_the_gap_has_become_and_moves_nothing_at_rest) {
  for (const double more : {0.0, 0.05, 0.15, 0.25}) {
    Params p = followed();
    // With how much of the friction stops are planned is nothing to what is seen while the axis turns.
    p.flank_friction_share = more > 0.1 ? 0.5 : 1.0;
    State s;
    Machine m;
    m.backlash = more * kMm;
    const Seen seen = moves(p, s, m, kThere);
    // It stays behind by three standard deviations: of noise alone a hundredth of a millimetre.
    EXPECT_NEAR(s.backlash_change_rad / kMm, more, 0.01) << more;
    EXPECT_EQ(seen.changes > 0, more > 0.0);
    // The integral goes on by what the noise of a scan is worth: 2 um/s, times Kpp and the ratio, a scan.
    EXPECT_LT(seen.speed_jump, 2e-6 * kTs * 10.0 * kRatio * 1.01);
  }
}

TEST(LostMotion, knows_a_gap_from_other_wind_up_friction_and_moment) {
  for (const double more : {0.0, 0.15}) {
    const Params p = followed();
    for (const double moment : {1.6e4, 3.6e4, -1.6e4}) {
      State s;
      Machine m;
      m.backlash = more * kMm;
      m.moment = moment;
      m.friction = 4.5e3;
      m.windup = 3e-10;       // a tenth of what the gears give way
      m.torque_noise = 2.57;  // N m r.m.s., 1 % of the rated torque: 2.9 kN m at the gantry in every scan
      moves(p, s, m, kThere);
      moves(p, s, m, kThere);
      EXPECT_NEAR(s.backlash_change_rad / kMm, more, 0.02) << moment;
    }
  }
}

TEST(LostMotion, follows_to_the_limit_and_back) {
  const Params p = followed();
  State s;
  Machine m;
  m.backlash = 0.4 * kMm;
  for (int k = 0; k < 2; ++k) moves(p, s, m, kThere);
  EXPECT_LE(s.backlash_change_rad, 6.0 * p.backlash_step_rad * (1.0 + 1e-12));
  EXPECT_GT(s.backlash_change_rad, 5.9 * p.backlash_step_rad);
  m.backlash = 0.1 * kMm;
  for (int k = 0; k < 10; ++k) moves(p, s, m, kThere);
  EXPECT_NEAR(s.backlash_change_rad / kMm, 0.1, 0.03);
}

TEST(LostMotion, learns_nothing_from_an_encoder_that_shows_none) {
  const Params p = followed();
  State s, t;
  Machine m, sometimes;
  m.backlash = sometimes.backlash = 0.2 * kMm;
  for (int k = 0; k < 3000; ++k)
    compensated_law(law(), p, s, {1.0 + 1e-4 * k, 0.1, 0.0}, kRatio * (1.0 + 1e-4 * k), kNaN, 10.0);
  for (const double sum : s.lead_sums) EXPECT_EQ(sum, 0.0);
  moves(p, t, sometimes, kThere, kNaN);
  EXPECT_NEAR(t.backlash_change_rad / kMm, 0.2, 0.01);
}

// Half a swing lasts 1.2 scans; a bank of 3.5 rad, of which 0.5 are in the calibration.
Params round_numbers() {
  Params p;
  p.moment_observer = p.backlash_observer = p.reversal = true;
  p.swing_rad_s = 5.0;
  p.period_s = kPi / 6.0;
  p.friction_nm = 10.0;
  p.friction_load_nm = 2.0;
  p.flank_friction_share = 0.25;  // of stops: what is seen has all of it
  p.observer_speed_rad_s = 0.1;
  p.observer_rate = 0.5;
  p.backlash_memory = 0.5;
  p.backlash_step_rad = p.backlash_held_rad = 0.5;
  p.pos_limit_rad = p.encoder_limit_rad = 10.0;
  return p;
}

// 8 N m sin 30 deg and 2 N m of friction load the flank by 6 N m, the load lies 0.01 rad further back than
// the maps and half of 0.06 rad say. Half of what was there before is left.
TEST(LostMotion, adds_the_products_of_its_columns) {
  const Params p = round_numbers();
  for (double z : {1.0, -1.0}) {
    State s;
    s.direction = z;
    s.backlash_change_rad = 0.06;
    s.seen_friction = 0.5;  // N m more, of which the half is taken in a scan
    s.lead_sums.fill(8.0);
    observe_lost_motion(p, {8.0, 0.0}, {z * kPi / 6.0, z * 0.2, 0.0}, z * 0.02, s);
    const double row[] = {1.0, z * 0.5, 0.8660254037844386, z, z, z * 0.01};
    std::size_t next = 0;
    for (int i = 0; i < 6; ++i)
      for (int j = i; j < 6; ++j) EXPECT_NEAR(s.lead_sums[next++], 4.0 + row[i] * row[j], 1e-15) << i << j;
    EXPECT_NEAR(s.friction_change_nm, 0.25, 1e-15);
  }
}

// What says nothing of the flank says something of friction, if it is steady motion and a reading.
TEST(LostMotion, adds_nothing_where_the_flank_or_the_lead_is_not_known) {
  const Params p = round_numbers();
  struct Case {
    SetPoint<double> r;
    double direction, apart, moment_change;
    bool heard;
  };
  for (const Case& c : {Case{{0.0, 0.1, 0.0}, 1.0, 0.02, 0.0, false},    // no faster than the limit
                        Case{{0.0, -0.1, 0.0}, -1.0, 0.02, 0.0, false},  //
                        Case{{0.0, 0.2, 0.0}, -1.0, 0.02, 0.0, false},   // turning round
                        Case{{0.0, 0.2, 0.0}, 0.5, 0.02, 0.0, false},    //
                        Case{{0.0, 0.2, 0.0}, 1.0, 1.0, 0.0, false},     // no load of this motor
                        Case{{0.0, 0.2, 0.0}, 1.0, -1.5, 0.0, false},    //
                        Case{{0.0, 0.2, 0.0}, 1.0, kNaN, 0.0, false},    //
                        Case{{0.0, 0.2, 0.01}, 1.0, 0.02, 0.0, true},    // accelerated
                        Case{{1.5707963267948966, 0.2, 0.0}, 1.0, 0.02, 0.0, true},  // 2 of 5 N m
                        Case{{0.0, 0.2, 0.0}, 1.0, 0.02, 3.0, true},     // another moment was seen
                        Case{{0.0, 0.2, 0.0}, 1.0, 0.02, 1.0, true}}) {  // by half of the friction
    State s;
    s.direction = c.direction;
    s.moment_sine_nm = c.moment_change;
    s.seen_friction = 0.5;
    s.lead_sums.fill(8.0);
    observe_lost_motion(p, {0.0, 8.0}, c.r, c.apart, s);
    for (double each : s.lead_sums) EXPECT_EQ(each, 8.0);
    EXPECT_NEAR(s.friction_change_nm, c.heard ? 0.25 : 0.0, 1e-15);
  }
  State s;
  s.direction = 1.0;
  observe_lost_motion(p, {0.0, 3.0}, {0.0, 0.2, 0.0}, 0.02, s);            // 5 N m, half of all friction
  observe_lost_motion(p, {4.0, 0.0}, {kPi / 6.0, 0.2, 0.0}, 0.02, s);      // 2 and 2 N m
  observe_lost_motion(p, {4.0, -4.6188}, {kPi / 6.0, 0.2, 0.0}, 0.02, s);  // and 4 against them
  for (double each : s.lead_sums) EXPECT_EQ(each, 0.0);
}

TEST(LostMotion, is_not_looked_for_where_nobody_follows_the_backlash) {
  Params p = followed();
  p.backlash_observer = false;
  State s;
  for (int k = 0; k < 20; ++k)
    compensated_law(law(), p, s, {1.0 + 1e-4 * k, 0.1, 0.0}, kRatio * (1.0 + 1e-4 * k), 1.0 + 1e-4 * k, 10.0);
  for (const double sum : s.lead_sums) EXPECT_EQ(sum, 0.0);
  EXPECT_EQ(s.moved, 0.0);
}

// Sums whose equations, the ridge of 1e-4 on their diagonal, have the pivots 16, 2, 2, 2, 4 and the solution
// (1, -1, 2, -2, 0.5) x size; `left` is what it leaves of the square of the lead.
void fill_sums(State& s, double size, double left) {
  const double sums[] = {16, 16, 16, 16, 16, 8, 18, 18, 18, 18, 7, 20, 20, 20, 8, 22, 22, 5, 26, 7, 0};
  for (std::size_t n = 0; n < kLeadSums; ++n) s.lead_sums[n] = sums[n];
  for (std::size_t diagonal : {0u, 6u, 11u, 15u, 18u}) s.lead_sums[diagonal] -= 1e-4;
  for (std::size_t lead : {5u, 10u, 14u, 17u, 19u}) s.lead_sums[lead] *= size;
  s.lead_sums[20] = 10.5 * size * size + left;
}

TEST(LostMotion, solves_its_five_equations) {
  const Params p = round_numbers();
  State s;
  for (double size : {1.0, -3.0}) {
    fill_sums(s, size, 6.4);
    EXPECT_NEAR(lost_motion_seen(p, s).change_rad, size * 1.0, 1e-12);
    EXPECT_NEAR(lost_motion_seen(p, s).deviation_rad, 2.0 * std::sqrt(6.4 / 15.9999 * 1.2 / 4.0), 1e-12);
  }
  fill_sums(s, 1.0, -0.5);  // rounding must not leave less than nothing
  EXPECT_EQ(lost_motion_seen(p, s).deviation_rad, 0.0);
  s.lead_sums[0] = 10.0 * alike_scans(p);  // two samples for each unknown are not enough
  EXPECT_EQ(lost_motion_seen(p, s).deviation_rad, 1.0);
}

struct Taken {
  double backlash, bias, twist;
};

// The end of a move with 0.1 rad in use, a bias of 0.5 rad and a resting twist of 1 rad. What is seen has a
// standard deviation of 0.1 rad; the load lies on one flank, so half of the backlash is led.
Taken at_the_end(const Params& p, double seen, double side = 1.0, double bias = 0.5) {
  State s;
  s.direction = 1.0;
  s.moved = 1.0;
  s.backlash_change_rad = 0.1;
  s.bias_rad = bias;
  s.twist_slow_rad = 1.0;
  fill_sums(s, seen, 0.0025 * 4.0 * 15.9999 / 1.2);
  use_lost_motion(p, {side * 10.0, 0.0}, {0.2, 2.0, 0.0}, {kPi / 2.0, 0.0, 0.0}, s);
  EXPECT_EQ(s.moved, 0.0);
  return {s.backlash_change_rad, s.bias_rad, s.twist_slow_rad};
}

void expect_taken(const Taken& t, double backlash, double bias, double twist) {
  EXPECT_NEAR(t.backlash, backlash, 1e-12);
  EXPECT_NEAR(t.bias, bias, 1e-12);
  EXPECT_NEAR(t.twist, twist, 1e-12);
}

// It stays behind by 0.3 rad; -0.5 and 3 rad are the ends of the bank.
TEST(LostMotion, takes_what_is_sure_and_gives_the_lead_back) {
  Params p = round_numbers();
  expect_taken(at_the_end(p, 1.0), 0.7, 0.5 - 0.3, 1.0 - 0.3);
  expect_taken(at_the_end(p, 1.0, -1.0), 0.7, 0.5 + 0.3, 1.0 + 0.3);
  expect_taken(at_the_end(p, -0.4), -0.1, 0.5 + 0.1, 1.0 + 0.1);
  expect_taken(at_the_end(p, 0.3), 0.1, 0.5, 1.0);
  expect_taken(at_the_end(p, -0.1), 0.1, 0.5, 1.0);
  expect_taken(at_the_end(p, 10.0), 2.7, 0.5 - 1.3, 1.0 - 1.3);
  expect_taken(at_the_end(p, -10.0), -0.2, 0.5 + 0.15, 1.0 + 0.15);
}

// A bias beyond its limit would move the motor: then nothing is taken. At the limit itself it is.
TEST(LostMotion, takes_nothing_that_the_load_side_loop_cannot_give_back) {
  Params p = round_numbers();
  const double just = at_the_end(p, 1.0).bias;
  p.encoder_limit_rad = just;
  expect_taken(at_the_end(p, 1.0), 0.7, 0.2, 0.7);
  p.encoder_limit_rad = 0.19;
  expect_taken(at_the_end(p, 1.0), 0.1, 0.5, 1.0);
  p.encoder_limit_rad = 0.7;
  expect_taken(at_the_end(p, 1.0, 1.0, -0.5), 0.1, -0.5, 1.0);
  EXPECT_EQ(at_the_end(p, 1.0, 1.0, kNaN).backlash, 0.1);
}

TEST(LostMotion, is_used_once_at_the_end_of_a_move) {
  const Params p = round_numbers();
  State s;
  fill_sums(s, 1.0, 0.0);
  const auto scan = [&](double vel, double acc) {
    use_lost_motion(p, {10.0, 0.0}, {0.2, 2.0, 0.0}, {kPi / 2.0, vel, acc}, s);
  };
  scan(0.0, 0.0);  // it has not moved
  EXPECT_EQ(s.backlash_change_rad, 0.0);
  EXPECT_EQ(s.moved, 0.0);
  for (const auto& [vel, acc] : {std::pair{0.1, 0.0}, {0.0, 0.1}, {-0.1, 0.0}}) {
    scan(vel, acc);
    EXPECT_EQ(s.moved, 1.0);
    EXPECT_EQ(s.backlash_change_rad, 0.0);
  }
  scan(0.0, 0.0);
  EXPECT_NEAR(s.backlash_change_rad, 1.0, 1e-6);  // of what is left 1e-15 is rounding
  s.backlash_change_rad = 0.25;
  scan(0.0, 0.0);
  EXPECT_EQ(s.backlash_change_rad, 0.25);
}

// Of two axes side by side the one whose move has ended.
TEST(LostMotion, is_used_where_a_move_has_ended) {
  using Two = Pack<2>;
  CompensationParams<Two> p = example::in_every_lane<2>(round_numbers());
  State one;
  fill_sums(one, 1.0, 0.0);
  CompensationState<Two> s;
  for (std::size_t n = 0; n < kLeadSums; ++n) s.lead_sums[n] = one.lead_sums[n];
  set_lane(s.moved, 0, 1.0);
  use_lost_motion(p, {Two(10.0), Two(0.0)}, {Two(0.2), Two(2.0), Two(0.0)}, {Two(1.5), Two(0.0), Two(0.0)},
                  s);
  EXPECT_GT(lane(s.backlash_change_rad, 0), 0.9);
  EXPECT_EQ(lane(s.backlash_change_rad, 1), 0.0);
  EXPECT_EQ(lane(s.bias_rad, 1), 0.0);
}

// A base of 1e9 N m/rad leans by 20 urad under 20 kN m more: the ring goes with it, the load does not.
TEST(LostMotion, takes_the_lean_of_the_base_off_that_the_moment_has_brought) {
  Params p = followed();
  p.scale_map = true;
  p.lean_rad_per_nm = 1e-9;
  State s;
  s.moment_sine_nm = 2e4;
  EXPECT_NEAR(own_errors(p, s, kPi / 2.0), 2e-5, 1e-18);
  EXPECT_NEAR(own_errors(p, s, -kPi / 2.0), -2e-5, 1e-18);
  p.moment_observer = false;
  EXPECT_EQ(own_errors(p, s, kPi / 2.0), 0.0);
}

TEST(LostMotion, packs_give_each_lane_the_bits_that_it_has_alone) {
  constexpr int kLanes = 4;
  const Params p = followed();
  const CompensationParams<Pack<kLanes>> many = example::in_every_lane<kLanes>(p);
  CompensationState<Pack<kLanes>> states;
  State alone[kLanes];
  const PositionLawParams<Pack<kLanes>> l{10.0, 1.0, kRatio, 1.0, 200.0};
  for (int scan = 0; scan < 9000; ++scan) {
    const bool back = scan >= 4000, rests = scan >= 8000;
    const double part = 1e-4 * (rests ? 0 : back ? 8000 - scan : scan);
    const double pos = -0.2 + part, vel = rests ? 0.0 : back ? -0.1 : 0.1;
    const double torque = (1.6e4 * std::sin(pos) + (rests ? 0.0 : back ? -1.2e4 : 1.2e4)) / kRatio;
    Pack<kLanes> counts, ring;
    for (int k = 0; k < kLanes; ++k) {
      counts.lane[k] = kRatio * pos;
      ring.lane[k] = k == 3 && scan % 7 == 0 ? kNaN : pos - 4e-5 * k * (pos > 0.0 ? 1.0 : -1.0);
    }
    compensated_law(l, many, states, {Pack<kLanes>(pos), Pack<kLanes>(vel), Pack<kLanes>(0.0)}, counts, ring,
                    Pack<kLanes>(torque));
    for (int k = 0; k < kLanes; ++k) {
      compensated_law(law(), p, alone[k], {pos, vel, 0.0}, counts.lane[k], ring.lane[k], torque);
      ASSERT_EQ(states.backlash_change_rad.lane[k], alone[k].backlash_change_rad);
      ASSERT_EQ(states.bias_rad.lane[k], alone[k].bias_rad);
      for (std::size_t n = 0; n < kLeadSums; ++n)
        ASSERT_EQ(states.lead_sums[n].lane[k], alone[k].lead_sums[n]);
    }
  }
  EXPECT_NE(alone[2].backlash_change_rad, 0.0);
}

}  // namespace
}  // namespace gantry
