// The position loop: one line of algebra, a clamp, and NaN that must not be hidden.
#include "core/control/position_law.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/lane/pack.hpp"

namespace gantry {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

PositionLawParams<double> law() { return {10.0, 0.75, 1144.0, 1.5e-6, 125.0}; }

TEST(PositionLaw, is_gain_times_error_plus_feed_forward) {
  const auto r = position_law(law(), 0.01, 0.02, 7e6);
  EXPECT_NEAR(r.vel_cmd_rad_s, 10.0 * (1144.0 * 0.01 - 1.5e-6 * 7e6) + 0.75 * 1144.0 * 0.02, 1e-13);
  EXPECT_DOUBLE_EQ(r.pos_act_rad, 1.5e-6 * 7e6 / 1144.0);
  EXPECT_NEAR(r.pos_err_rad, 0.01 - r.pos_act_rad, 1e-17);
}

TEST(PositionLaw, stands_still_on_its_set_point) {
  EXPECT_EQ(position_law(law(), 0.0, 0.0, 0.0).vel_cmd_rad_s, 0.0);
}

TEST(PositionLaw, command_is_clamped_on_both_sides) {
  EXPECT_EQ(position_law(law(), 1.0, 0.0, 0.0).vel_cmd_rad_s, 125.0);
  EXPECT_EQ(position_law(law(), -1.0, 0.0, 0.0).vel_cmd_rad_s, -125.0);
  EXPECT_EQ(position_law(law(), 0.0, 5.0, 0.0).vel_cmd_rad_s, 125.0);
}

TEST(PositionLaw, the_error_shown_is_not_clamped) {
  EXPECT_EQ(position_law(law(), 1.0, 0.0, 0.0).pos_err_rad, 1.0);
}

TEST(PositionLaw, not_a_number_in_any_input_comes_out_as_not_a_number) {
  EXPECT_TRUE(std::isnan(position_law(law(), kNaN, 0.0, 0.0).vel_cmd_rad_s));
  EXPECT_TRUE(std::isnan(position_law(law(), 0.0, kNaN, 0.0).vel_cmd_rad_s));
  EXPECT_TRUE(std::isnan(position_law(law(), 0.0, 0.0, kNaN).vel_cmd_rad_s));
}

TEST(PositionLaw, without_parameters_commands_nothing_and_shows_the_shaft) {
  PositionLawParams<double> none;
  EXPECT_EQ(position_law(none, 1.0, 1.0, 7.0).vel_cmd_rad_s, 0.0);
  EXPECT_EQ(position_law(none, 1.0, 1.0, 7.0).pos_act_rad, 0.0);
  none.vel_max_rad_s = 1e9;
  EXPECT_EQ(position_law(none, 1.0, 1.0, 7.0).vel_cmd_rad_s, 0.0);  // no gain
  PositionLawParams<double> idle;  // a gain, and no speed that it may command
  idle.rad_per_count = 0.5;
  idle.kpp_per_s = 10.0;
  EXPECT_EQ(position_law(idle, 1.0, 1.0, 7.0).pos_act_rad, 3.5);
  EXPECT_EQ(position_law(idle, 1.0, 1.0, 7.0).vel_cmd_rad_s, 0.0);
}

TEST(PositionLaw, of_a_pack_is_that_of_each_number) {
  Pack<4> pos, vel, counts;
  for (int k = 0; k < 4; ++k) {
    pos.lane[k] = 0.01 * (k - 1.5);
    vel.lane[k] = 0.003 * k;
    counts.lane[k] = 1e6 * (k - 1);
  }
  const PositionLawParams<double> one_law = law();
  const PositionLawParams<Pack<4>> laws{one_law.kpp_per_s, one_law.kvf, one_law.ratio, one_law.rad_per_count,
                                        one_law.vel_max_rad_s};
  const auto pack = position_law(laws, pos, vel, counts);
  for (int k = 0; k < 4; ++k) {
    const auto one = position_law(law(), pos.lane[k], vel.lane[k], counts.lane[k]);
    EXPECT_EQ(pack.vel_cmd_rad_s.lane[k], one.vel_cmd_rad_s);
    EXPECT_EQ(pack.pos_act_rad.lane[k], one.pos_act_rad);
    EXPECT_EQ(pack.pos_err_rad.lane[k], one.pos_err_rad);
  }
}

}  // namespace
}  // namespace gantry
