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
    const Params p = followed();
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
