// A pack of plants is, lane by lane and bit for bit, the plants one by one: with other parameters, other
// starts and other commands in every lane, in every mode, through the brake and into the torque limit.
#include "core/lane/pack.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <vector>

#include "example.hpp"

namespace gantry {
namespace {

template <int N>
using Sims = std::vector<GantrySim<double>>;

template <int N>
PlantParams<Pack<N>> packed(const std::vector<PlantParams<double>>& plants) {
  PlantParams<Pack<N>> pack;
  for (int k = 0; k < N; ++k) {
    const PlantParams<double>& one = plants[static_cast<std::size_t>(k)];
#define X(name, value, meaning) pack.name.lane[k] = one.name;
    GANTRY_PLANT_PARAMS(X)
#undef X
    for (std::size_t n = 0; n < kRingHarmonics; ++n) {
      pack.error_ring_rad[n].lane[k] = one.error_ring_rad[n];
      pack.phase_ring_rad[n].lane[k] = one.phase_ring_rad[n];
    }
    for (std::size_t n = 0; n < kWindWaves; ++n) {
      pack.wind_wave_nm[n].lane[k] = one.wind_wave_nm[n];
      pack.wind_rate_rad_s[n].lane[k] = one.wind_rate_rad_s[n];
      pack.wind_phase_rad[n].lane[k] = one.wind_phase_rad[n];
    }
    set_tooth_pitch(pack.pitch, k, one.pitch);
#define X(name, type, value, meaning) pack.name = one.name;
    GANTRY_PLANT_SWITCHES(X)
#undef X
  }
  return pack;
}

template <int N>
DriveParams<Pack<N>> packed(const std::vector<DriveParams<double>>& drives) {
  DriveParams<Pack<N>> pack;
  for (int k = 0; k < N; ++k) {
    const DriveParams<double>& one = drives[static_cast<std::size_t>(k)];
#define X(name, value, meaning) pack.name.lane[k] = one.name;
    GANTRY_DRIVE_PARAMS(X)
#undef X
    pack.delay_cycles = one.delay_cycles;
    pack.encoder_errors = one.encoder_errors;
  }
  return pack;
}

// Equal bits: EXPECT_EQ would take -0 for 0 and never accept NaN.
void expect_bits(double a, double b, const char* name, int lane, int scan) {
  EXPECT_EQ(std::memcmp(&a, &b, sizeof a), 0)
      << name << ", lane " << lane << ", scan " << scan << ": " << a << " " << b;
}

template <int N>
void expect_same(const GantrySim<Pack<N>>& pack, const std::vector<GantrySim<double>>& ones, int scan) {
  for (int k = 0; k < N; ++k) {
    const GantrySim<double>& one = ones[static_cast<std::size_t>(k)];
#define X(name, ...) expect_bits(pack.x.name.lane[k], one.x.name, #name, k, scan);
    GANTRY_PLANT_STATE(X)
    GANTRY_PLANT_EFFECT_STATE(X)
#undef X
#define X(name, meaning) expect_bits(pack.s.name.lane[k], one.s.name, "drive " #name, k, scan);
    GANTRY_DRIVE_STATE(X)
#undef X
    expect_bits(pack.torque_mesh().lane[k], one.torque_mesh(), "torque_mesh", k, scan);
    expect_bits(pack.vel_report().lane[k], one.vel_report(), "vel_report", k, scan);
    expect_bits(pack.overload().lane[k], one.overload(), "overload", k, scan);
    expect_bits(pack.counts(Pack<N>(example::kFineCount)).lane[k], one.counts(example::kFineCount), "counts",
                k, scan);
    EXPECT_EQ(lane(pack.brake.closed, k), one.brake.closed);
    EXPECT_EQ(lane(pack.report.limited, k), one.report.limited);
  }
}

// Where in its day a lane is: each elsewhere, so that modes and brakes differ within the pack.
int own_scan(int scan, int lane) { return scan + 37 * lane; }

// A day in the life: standing, a fast swing into the torque limit, quick stop, brake, off, brake open, speed
// again.
DriveCommand<double> command_of(int scan, int lane) {
  const double lane_factor = 1.0 + 0.1 * lane;
  if (scan < 20) return {DriveMode::kSpeed, 0.0, 0.0};
  if (scan < 120) return {DriveMode::kSpeed, 40.0 * lane_factor * (lane % 2 ? -1.0 : 1.0), 5.0 * lane};
  if (scan < 200) return {DriveMode::kQuickStop, 0.0, 0.0};
  if (scan < 420) return {DriveMode::kOff, 0.0, 0.0};
  return {DriveMode::kSpeed, 0.5 * lane_factor * ((scan / 50) % 2 ? -1.0 : 1.0), 0.0};
}

bool brake_open_at(int scan) { return scan < 150 || scan >= 380; }

template <int N>
void expect_pack_equals_scalars(const std::vector<PlantParams<double>>& plants, Scheme scheme, int scans,
                                bool servo_on = true) {
  std::mt19937 random(11);
  std::vector<DriveParams<double>> drives;
  for (int k = 0; k < N; ++k) drives.push_back(example::varied(example::drive(), random));
  for (DriveParams<double>& each : drives) each.encoder_errors = plants[0].tooth_pitch;
  std::vector<GantrySim<double>> ones;
  GantrySim<Pack<N>> pack = example::sim(packed<N>(plants), packed<N>(drives), scheme);
  Pack<N> start;
  for (std::size_t k = 0; k < N; ++k) {
    start.lane[k] = 0.4 * (static_cast<double>(k) - 1.5);
    ones.push_back(example::sim(plants[k], drives[k], scheme));
    ones.back().static_start(start.lane[k], servo_on);
  }
  pack.static_start(start, servo_on);
  expect_same<N>(pack, ones, -1);
  for (int scan = 0; scan < scans; ++scan) {
    DriveCommand<Pack<N>> commands;
    Mask<N> open = mask<Pack<N>>(true);
    for (int k = 0; k < N; ++k) {
      const DriveCommand<double> c = command_of(own_scan(scan, k), k);
      set_lane(commands.off, k, c.off);
      set_lane(commands.quick_stop, k, c.quick_stop);
      set_lane(commands.vel_cmd_rad_s, k, c.vel_cmd_rad_s);
      set_lane(commands.torque_ff_nm, k, c.torque_ff_nm);
      set_lane(open, k, brake_open_at(own_scan(scan, k)));
      ones[static_cast<std::size_t>(k)].scan(c, brake_open_at(own_scan(scan, k)));
    }
    pack.scan(commands, open);
    expect_same<N>(pack, ones, scan);
    if (testing::Test::HasFailure()) return;
  }
}

std::vector<PlantParams<double>> varied_plants(int n, const PlantParams<double>& base) {
  std::mt19937 random(12);
  std::vector<PlantParams<double>> plants;
  for (int k = 0; k < n; ++k) plants.push_back(example::varied(base, random));
  return plants;
}

TEST(Pack, of_four_plants_is_four_plants) {
  expect_pack_equals_scalars<4>(varied_plants(4, example::plant()), Scheme::kOneEvaluation, 700);
}

TEST(Pack, of_eight_plants_is_eight_plants) {
  expect_pack_equals_scalars<8>(varied_plants(8, example::plant()), Scheme::kOneEvaluation, 700);
}

TEST(Pack, equals_the_plants_under_runge_kutta) {
  expect_pack_equals_scalars<4>(varied_plants(4, example::plant()), Scheme::kRungeKutta4, 300);
  expect_pack_equals_scalars<8>(varied_plants(8, example::plant()), Scheme::kRungeKutta4, 100);
}

TEST(Pack, equals_the_plants_when_the_brake_holds_them) {
  expect_pack_equals_scalars<4>(varied_plants(4, example::plant()), Scheme::kOneEvaluation, 100, false);
}

TEST(Pack, equals_plants_in_the_wind) {
  PlantParams<double> p = example::plant();
  p.wind = true;
  expect_pack_equals_scalars<4>(varied_plants(4, p), Scheme::kOneEvaluation, 300);
  expect_pack_equals_scalars<4>(varied_plants(4, p), Scheme::kRungeKutta4, 100);
  p.rigid = true;
  p.gear_error = p.backlash = p.hysteresis = p.base = false;
  expect_pack_equals_scalars<4>(varied_plants(4, p), Scheme::kOneEvaluation, 100);
}

TEST(Pack, equals_plants_with_every_effect) {
  PlantParams<double> p = example::beyond(example::plant());
  expect_pack_equals_scalars<8>(varied_plants(8, p), Scheme::kOneEvaluation, 700);
  expect_pack_equals_scalars<4>(varied_plants(4, p), Scheme::kRungeKutta4, 100);
  expect_pack_equals_scalars<4>(varied_plants(4, p), Scheme::kOneEvaluation, 50, false);
  p.rigid = true;
  p.gear_error = p.backlash = p.hysteresis = p.base = p.tooth_pitch = false;
  expect_pack_equals_scalars<4>(varied_plants(4, p), Scheme::kOneEvaluation, 300);
}

TEST(Pack, equals_plants_on_two_pinions) {
  for (int lost : {0, 1, 2}) {
    const PlantParams<double> p = example::on_two_pinions(example::plant(), lost);
    expect_pack_equals_scalars<8>(varied_plants(8, p), Scheme::kOneEvaluation, 500);
    expect_pack_equals_scalars<4>(varied_plants(4, p), Scheme::kRungeKutta4, 60);
    expect_pack_equals_scalars<4>(varied_plants(4, p), Scheme::kOneEvaluation, 50, false);
  }
  const PlantParams<double> all = example::on_two_pinions(example::beyond(example::plant()));
  expect_pack_equals_scalars<4>(varied_plants(4, all), Scheme::kOneEvaluation, 300);
}

TEST(Pack, equals_rigid_plants) {
  PlantParams<double> p = example::plant();
  p.rigid = true;
  p.gear_error = p.backlash = p.hysteresis = p.base = false;
  expect_pack_equals_scalars<4>(varied_plants(4, p), Scheme::kOneEvaluation, 300);
  expect_pack_equals_scalars<4>(varied_plants(4, p), Scheme::kRungeKutta4, 100);
}

TEST(Pack, equals_the_plants_without_any_effect) {
  PlantParams<double> p = example::plant();
  p.gear_error = p.hysteresis = p.backlash = p.roller_friction = p.motor_friction = p.base = p.ripple = false;
  p.half_backlash_rad = 0.0;
  expect_pack_equals_scalars<8>(varied_plants(8, p), Scheme::kOneEvaluation, 300);
}

TEST(Pack, may_hold_ideal_and_real_current_loops_encoders_and_gears_side_by_side) {
  std::vector<PlantParams<double>> plants = varied_plants(4, example::plant());
  plants[1].current_bandwidth_rad_s = 0.0;
  plants[2].half_backlash_rad = 0.0;
  plants[2].ripple_torque_nm = 0.0;
  plants[3].eccentric_moment_nm = 0.0;
  for (Scheme scheme : {Scheme::kOneEvaluation, Scheme::kRungeKutta4})
    expect_pack_equals_scalars<4>(plants, scheme, 200);
}

}  // namespace
}  // namespace gantry
