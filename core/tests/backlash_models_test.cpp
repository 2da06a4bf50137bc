// One scan of the backlash observer by hand, on round numbers.
#include <gtest/gtest.h>

#include <limits>

#include "core/control/backlash_observer.hpp"

namespace gantry {
namespace {

using Params = CompensationParams<double>;
using State = CompensationState<double>;
using Model = LoadModel<double>;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// A load of 4 kg m2 on 100 N m/rad, so damped with 0.04 sqrt(400) = 0.8 N m s/rad; half of what is
// transmitted is lost; a scan takes 0.1 s.
Params round_numbers() {
  Params p;
  p.moment_observer = p.backlash_observer = true;
  p.period_s = 0.1;
  p.inertia_load_kg_m2 = 4.0;
  p.inertia_kg_m2 = 7.0;
  p.windup_per_acc_s2 = 0.04;
  p.friction_nm = 5.0;
  p.friction_load_nm = 2.0;
  p.friction_load_ratio = 0.5;
  p.friction_spread_nm = 10.0;
  p.moment_limit_nm = 100.0;
  p.swing_rad_s = 2.0;
  p.observer_weight = 4.0;
  p.observer_rate = 0.5;
  p.backlash_step_rad = 0.5;
  p.backlash_held_rad = 1.0;
  p.backlash_memory = 0.9;
  p.backlash_fast = 0.5;
  p.backlash_slow = 0.25;
  return p;
}

TEST(BacklashModel, is_a_damped_spring_behind_a_gap_that_cannot_pull) {
  const Params p = round_numbers();
  for (double side : {1.0, -1.0}) {
    Model m;
    m.vel_rad_s = side * 2.0;
    const auto torque = [&](double twist, double vel) {
      m.twist_rad = side * twist;
      return side * model_torque(p, m, 0.2, side * vel);
    };
    EXPECT_NEAR(torque(0.15, 2.0), 5.0, 1e-12);
    EXPECT_NEAR(torque(0.15, 3.0), 5.8, 1e-12);
    EXPECT_NEAR(torque(0.15, -3.0), 1.0, 1e-12);
    EXPECT_EQ(torque(0.15, -8.0), 0.0);  // 3 N m backwards
    EXPECT_EQ(torque(0.09, 3.0), 0.0);
  }
}

TEST(BacklashModel, leaves_what_spring_and_loss_do_not_explain) {
  const Params p = round_numbers();
  LoadInputs<double> in{};
  in.torque_nm = 10.0;
  for (const auto& [direction, left] : {std::pair{1.0, 12.0}, {0.0, 14.0}, {-1.0, 16.0}}) {
    in.direction = direction;
    EXPECT_NEAR(model_error(p, in, -4.0), left, 1e-12);
  }
}

// 3 N m wind the spring up by 0.03 rad; friction of 6 N m holds the load in the middle between the middle of
// the gap of 0.2 rad and its flank, friction of 2 N m does not.
TEST(BacklashModel, begins_on_the_flank_or_where_friction_holds_it) {
  const Params p = round_numbers();
  for (double side : {1.0, -1.0}) {
    LoadInputs<double> in{};
    in.torque_nm = side * 10.0;
    in.moment_nm = side * 3.0;
    in.friction_nm = 6.0;
    in.direction = side;
    Model m;
    m.vel_rad_s = 9.0;
    begin_model(p, in, 0.2, false, m);
    EXPECT_NEAR(m.twist_rad, side * 0.08, 1e-12);
    EXPECT_EQ(m.vel_rad_s, 0.0);
    for (double filtered : {m.fast_nm, m.smooth_nm, m.slow_nm}) EXPECT_NEAR(filtered, side * 10.0, 1e-12);
    in.friction_nm = 2.0;
    begin_model(p, in, 0.2, false, m);
    EXPECT_NEAR(m.twist_rad, side * 0.13, 1e-12);
    for (double filtered : {m.fast_nm, m.smooth_nm, m.slow_nm}) EXPECT_NEAR(filtered, side * 5.5, 1e-12);
    m = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6};
    begin_model(p, in, 0.2, true, m);
    EXPECT_EQ(m.twist_rad, 0.1);
    EXPECT_EQ(m.vel_rad_s, 0.2);
    EXPECT_EQ(m.fast_nm, 0.3);
    EXPECT_EQ(m.smooth_nm, 0.4);
    EXPECT_EQ(m.slow_nm, 0.5);
  }
}

// 5 N m in the mesh leave 10 - 5 - 2.5 = 2.5 N m: filtered from 4, 2 and 1 N m to 3.25, 2.625 and 1.40625 N
// m, a swing of 1.21875 N m. In 0.1 s 4 N m turn 4 kg m2 faster by 0.1 rad/s, friction of 3 N m takes 0.075
// rad/s. Half of the swing per radian, 2 rad/s x 1.21875 N m / 100 N m/rad, leads the model back.
TEST(BacklashModel, runs_through_a_scan) {
  const Params p = round_numbers();
  for (double side : {1.0, -1.0}) {
    const Model before{side * 0.15, side * 0.3, side * 4.0, side * 2.0, side * 1.0, 7.0};
    LoadInputs<double> in{side * 0.01, side * 0.3, side * 10.0, side * 1.0, 3.0, side};
    Model m = before;
    run_model(p, in, 0.2, true, 2.0, 0.9, m);
    EXPECT_NEAR(m.fast_nm, side * 3.25, 1e-12);
    EXPECT_NEAR(m.smooth_nm, side * 2.625, 1e-12);
    EXPECT_NEAR(m.slow_nm, side * 1.40625, 1e-12);
    EXPECT_NEAR(m.misfit, 6.3 + 2.0 * 1.4853515625, 1e-12);
    EXPECT_NEAR(m.vel_rad_s, side * 0.325, 1e-12);
    EXPECT_NEAR(m.twist_rad, side * (0.15 + 0.01 - 0.0325 + 0.00121875), 1e-12);
    m = before;  // nothing is heard: the last of it is filtered on
    run_model(p, in, 0.2, false, 0.0, 1.0, m);
    EXPECT_NEAR(m.fast_nm, side * 4.0, 1e-12);
    EXPECT_NEAR(m.smooth_nm, side * 3.0, 1e-12);
    EXPECT_NEAR(m.slow_nm, side * 1.5, 1e-12);
    EXPECT_EQ(m.misfit, 7.0);
    m = before;
    in.friction_nm = 1e3;
    run_model(p, in, 0.2, true, 0.0, 1.0, m);
    EXPECT_EQ(m.vel_rad_s, 0.0);
  }
}

// Sums of squares 3 (k - x)^2 / 49 and the prior (k - 2)^2 / 49 have their least at (3 x + 2) / 4 steps.
TEST(BacklashModel, least_misfit_is_found_between_the_models) {
  const Params p = round_numbers();
  const auto seen = [&](double least) {
    State s;
    const double x = (4.0 * least - 2.0) / 3.0;
    for (std::size_t k = 0; k < kBacklashModels; ++k) {
      const double apart = static_cast<double>(k) - x;
      s.bank[k].misfit = 3.0 * apart * apart / 49.0;
    }
    return backlash_seen(p, s) / p.backlash_step_rad;
  };
  for (double least : {0.0, 0.25, 0.75, 1.0, 1.25, 2.25, 2.75, 3.25, 4.25, 5.25, 6.25, 6.75, 7.0})
    EXPECT_NEAR(seen(least), least, 1e-9);
  EXPECT_NEAR(seen(-1.75), 0.0, 1e-12);
  EXPECT_NEAR(seen(-0.4), 0.0, 1e-12);
  EXPECT_NEAR(seen(7.4), 7.0, 1e-12);
  EXPECT_NEAR(seen(15.5), 7.0, 1e-12);
}

// One model that fits and seven that do not, by 100: the prior of 1 / 49 moves the place by no more than a
// thousandth of a step.
TEST(BacklashModel, a_model_that_fits_alone_is_found) {
  const Params p = round_numbers();
  for (std::size_t fits = 1; fits + 1 < kBacklashModels; ++fits) {
    State s;
    for (Model& m : s.bank) m.misfit = 100.0;
    s.bank[fits].misfit = 0.0;
    EXPECT_NEAR(backlash_seen(p, s), 0.5 * static_cast<double>(fits), 1e-3);
  }
}

// A hill in place of a valley, at either end of the bank: the lower of its feet.
TEST(BacklashModel, of_a_hill_the_lower_foot_counts) {
  const Params p = round_numbers();
  State s;
  for (Model& m : s.bank) m.misfit = 100.0;
  s.bank[0].misfit = 1.0;
  s.bank[1].misfit = 5.0;
  s.bank[2].misfit = 6.0;
  EXPECT_NEAR(backlash_seen(p, s), 0.0, 1e-12);
  for (Model& m : s.bank) m.misfit = 100.0;
  s.bank[7].misfit = 1.0;
  s.bank[6].misfit = 5.0;
  s.bank[5].misfit = 6.0;
  EXPECT_NEAR(backlash_seen(p, s), 3.5, 1e-12);
}

// A bank of which every model has a twist of 0.1 rad and turns with the motor, 0.02 rad/s in the end. Of 10 x
// 2 N m the motor's own 3 kg m2 take 0.3 N m and its friction 3 N m; the model without a gap carries 10 N m
// and loses 5 N m: 1.7 N m are left, filtered to 0.85, 0.425 and 0.10625 N m.
struct Scan {
  Params p = round_numbers();
  State s;
  SetPoint<double> r{0.0, 0.02, 1.0};
  double x = 0.502, torque = 2.0;

  Scan() {
    s.motor_last_rad = 0.5;
    s.motor_vel_rad_s = 0.01;
    for (Model& m : s.bank) m = {0.1, 0.02, 0.0, 0.0, 0.0, 7.0};
  }
  double run(bool going = true) { return observe_backlash(p, 10.0, r, x, torque, going, s); }
};

constexpr double kSwing = 0.425 - 0.10625;

TEST(BacklashScan, takes_what_accelerates_and_rubs_before_the_mesh_off_the_torque) {
  Scan scan;
  scan.run();
  EXPECT_NEAR(scan.s.bank[0].fast_nm, 0.85, 1e-12);
  EXPECT_NEAR(scan.s.bank[0].misfit, 0.9 * 7.0 + 4.0 * kSwing * kSwing, 1e-12);
  EXPECT_EQ(scan.s.motor_last_rad, 0.502);
  EXPECT_NEAR(scan.s.motor_vel_rad_s, 0.02, 1e-12);
  // With its gap of half a radian the next model carries nothing.
  EXPECT_NEAR(scan.s.bank[1].fast_nm, 0.5 * 16.7, 1e-12);
  EXPECT_NEAR(scan.s.bank[0].twist_rad, 0.1 + 0.002 + 0.1 * (0.01 * kSwing - scan.s.bank[0].vel_rad_s),
              1e-12);
  Scan back;  // as a mirror
  back.s.motor_last_rad = -0.5;
  back.s.motor_vel_rad_s = -0.01;
  for (Model& m : back.s.bank) m = {-0.1, -0.02, 0.0, 0.0, 0.0, 7.0};
  back.r = {0.0, -0.02, -1.0};
  back.x = -0.502;
  back.torque = -2.0;
  back.run();
  EXPECT_NEAR(back.s.bank[0].fast_nm, -0.85, 1e-12);
  EXPECT_NEAR(back.s.bank[0].misfit, scan.s.bank[0].misfit, 1e-12);
}

// Friction behind the mesh of 2 N m, three times as much when all friction has become 10 N m more than 5 N m,
// brakes the load: 10 N m x 0.025 rad/s per N m less 0.05 and 0.15 rad/s. A moment of 6 N m at a quarter turn
// takes 0.15 rad/s.
TEST(BacklashScan, load_is_braked_by_friction_and_moment) {
  Scan scan;
  scan.run();
  EXPECT_NEAR(scan.s.bank[0].vel_rad_s, 0.02 + 0.25 - 0.05, 1e-12);
  Scan stiff;
  stiff.s.friction_change_nm = 10.0;
  stiff.run();
  EXPECT_NEAR(stiff.s.bank[0].vel_rad_s, 0.02 + 0.25 - 0.15, 1e-12);
  Scan loaded;
  loaded.r.pos = 1.570796326794896619;
  loaded.p.moment_sine_nm = 5.6;
  loaded.s.moment_sine_nm = 0.4;
  loaded.run();
  EXPECT_NEAR(loaded.s.bank[0].vel_rad_s, 0.02 + 0.25 - 0.05 - 0.15, 1e-12);
}

// The sums are kept at constant speed, at rest, without a torque, and while the moment in use is more than
// half of the friction of 2 N m away from the one that is seen.
TEST(BacklashScan, tells_only_of_a_known_load_that_is_accelerated) {
  const auto misfit = [](const auto& change) {
    Scan scan;
    change(scan);
    scan.run();
    return scan.s.bank[0].misfit;
  };
  EXPECT_NE(misfit([](Scan&) {}), 7.0);
  EXPECT_NE(misfit([](Scan& a) { a.r.acc = -1.6; }), 7.0);
  EXPECT_NE(misfit([](Scan& a) { a.s.moment_sine_nm = 0.9; }), 7.0);
  EXPECT_NE(misfit([](Scan& a) { a.s.moment_cosine_nm = -0.9; }), 7.0);
  EXPECT_NE(misfit([](Scan& a) {  // 1.5 N m are in use and 0.9 N m are seen: 0.009 / (0.0099 + 1e-4)
              a.s.moment_sine_nm = a.s.moment_cosine_nm = 1.5;
              a.s.info_sine = a.s.info_cosine = 0.0099;
              a.s.seen_sine = a.s.seen_cosine = 0.009;
            }),
            7.0);
  EXPECT_EQ(misfit([](Scan& a) { a.s.moment_sine_nm = 1.1; }), 7.0);
  EXPECT_EQ(misfit([](Scan& a) { a.s.moment_cosine_nm = -1.1; }), 7.0);
  EXPECT_EQ(misfit([](Scan& a) { a.r.acc = 0.0; }), 7.0);
  EXPECT_EQ(misfit([](Scan& a) { a.r.vel = 0.0; }), 7.0);
  EXPECT_EQ(misfit([](Scan& a) { a.torque = kNaN; }), 7.0);
  EXPECT_EQ(misfit([](Scan& a) { a.torque = -1e12; }), 7.0);
  EXPECT_EQ(misfit([](Scan& a) { a.torque = 1e12; }), 7.0);  // 1e13 N m at the gantry
  EXPECT_EQ(misfit([](Scan& a) { a.x = 0.511; }), 7.0);
  EXPECT_EQ(misfit([](Scan& a) { a.x = 0.489; }), 7.0);
}

// Planned are 4 kg m2 times the acceleration and 2 N m of friction, and 6 N m at a quarter turn where there
// is a moment. Between -4 and 4 N m nobody knows on which flank the load lies.
TEST(BacklashScan, tells_only_where_the_planned_torque_lies_clearly_on_one_flank) {
  const auto misfit = [](double vel, double acc, double moment, double more_friction) {
    Scan scan;
    scan.r = {1.570796326794896619, vel, acc};
    scan.p.moment_sine_nm = moment;
    scan.s.friction_change_nm = more_friction;
    scan.run();
    return scan.s.bank[0].misfit;
  };
  for (double side : {1.0, -1.0}) {
    const double vel = side * 0.02;
    EXPECT_NE(misfit(vel, side * 0.6, 0.0, 0.0), 7.0);          // 4.4 N m
    EXPECT_EQ(misfit(vel, side * 0.4, 0.0, 0.0), 7.0);          // 3.6 N m
    EXPECT_EQ(misfit(vel, side * -1.4, 0.0, 0.0), 7.0);         // -3.6 N m
    EXPECT_NE(misfit(vel, side * -1.6, 0.0, 0.0), 7.0);         // -4.4 N m
    EXPECT_NE(misfit(vel, side * -0.9, side * 6.0, 0.0), 7.0);  // 4.4 N m
    EXPECT_EQ(misfit(vel, side * -1.1, side * 6.0, 0.0), 7.0);  // 3.6 N m
    EXPECT_EQ(misfit(vel, side * -2.9, side * 6.0, 0.0), 7.0);  // -3.6 N m
    EXPECT_NE(misfit(vel, side * -3.1, side * 6.0, 0.0), 7.0);  // -4.4 N m
    EXPECT_EQ(misfit(vel, 0.0, side * 6.0, 0.0), 7.0);  // 8 N m, but nothing that makes the load swing
    // With 2.5 N m more of 5 N m there are 3 N m behind the mesh: between -6 and 6 N m.
    EXPECT_EQ(misfit(vel, side * 0.7, 0.0, 2.5), 7.0);   // 5.8 N m
    EXPECT_NE(misfit(vel, side * 0.8, 0.0, 2.5), 7.0);   // 6.2 N m
    EXPECT_EQ(misfit(vel, side * -2.2, 0.0, 2.5), 7.0);  // -5.8 N m
    EXPECT_NE(misfit(vel, side * -2.3, 0.0, 2.5), 7.0);  // -6.2 N m
  }
}

// What is seen and not yet in use is followed by half in each scan in motion: of the backlash the way from
// 0.7 rad, of the friction that from 1 N m to 10 N m, its spread.
// Sums of 1, 0 and 1/2 about the third model, with the prior: the parabola through them has its lowest point
// a sixth of a step further on.
TEST(BacklashScan, looks_at_every_model) {
  State s;
  for (std::size_t k = 0; k < kBacklashModels; ++k) {
    const double apart = static_cast<double>(k) - 2.0;
    s.bank[k].misfit = (k == 2 ? 0.0 : k == 3 ? 0.5 : 1.0) - apart * apart / 49.0;
  }
  EXPECT_NEAR(backlash_seen(round_numbers(), s), (2.0 + 1.0 / 6.0) * 0.5, 1e-12);
}

TEST(BacklashScan, follows_in_motion) {
  for (double side : {1.0, -1.0}) {
    Scan scan;
    scan.s.backlash_change_rad = 0.7;
    scan.s.friction_change_nm = 1.0;
    scan.s.info_friction = 0.99;  // and 1 / 10^2 of its prior
    scan.s.seen_friction = side * 30.0;
    scan.r.acc = 0.0;
    for (std::size_t k = 0; k < kBacklashModels; ++k) {
      const double apart = static_cast<double>(k) - 5.0;
      scan.s.bank[k].misfit =
          3.0 * apart * apart / 49.0;  // 4.25 steps: 2.125 rad, 1.125 rad beside what is held
    }
    Scan rest = scan;
    EXPECT_NEAR(scan.run(), 2.125, 1e-12);
    EXPECT_NEAR(scan.s.backlash_change_rad, 0.5 * (0.7 + 1.125), 1e-12);
    EXPECT_NEAR(scan.s.friction_change_nm, 0.5 * (1.0 + side * 10.0), 1e-12);
    for (double sum : scan.s.lead_sums) EXPECT_EQ(sum, 0.0);  // of an encoder on the ring, behind the bank
    rest.r.vel = 0.0;
    rest.run();
    EXPECT_EQ(rest.s.backlash_change_rad, 0.7);
    EXPECT_EQ(rest.s.friction_change_nm, 1.0);
  }
}

// A motor that is not seen goes on with its speed, one that has jumped is where it says.
TEST(BacklashScan, goes_on_without_an_angle) {
  for (double x : {kNaN, 1.2e4, -1.2e4}) {
    Scan scan;
    scan.x = x;
    scan.run();
    EXPECT_NEAR(scan.s.motor_last_rad, 0.501, 1e-12);
    EXPECT_NEAR(scan.s.motor_vel_rad_s, 0.01, 1e-12);
    EXPECT_EQ(scan.s.bank[0].fast_nm, 0.0);
  }
  Scan jumped;
  jumped.x = 9e3;
  jumped.run();
  EXPECT_EQ(jumped.s.motor_last_rad, 9e3);
  EXPECT_NEAR(jumped.s.motor_vel_rad_s, 0.01, 1e-12);
}

// The first scan takes the motor as it finds it, at rest, and puts each model on its flank: 16.7 N m is all
// that it hears, and 3 N m wind the spring up by 0.03 rad.
TEST(BacklashScan, begins_where_the_motor_is) {
  Scan scan;
  scan.torque = 1.97;
  scan.p.moment_cosine_nm = 3.0;
  scan.run(false);
  EXPECT_EQ(scan.s.motor_last_rad, 0.502);
  EXPECT_EQ(scan.s.motor_vel_rad_s, 0.0);
  EXPECT_NEAR(scan.s.bank[0].slow_nm, 16.7 - 3.0 - 1.5, 1e-9);
  Scan blind;
  blind.x = kNaN;
  blind.run(false);
  EXPECT_EQ(blind.s.motor_last_rad, 0.0);
}

}  // namespace
}  // namespace gantry
