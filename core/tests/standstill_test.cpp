// Where everything is when a simulation begins, and what a simulator shows of itself, by hand.
#include <gtest/gtest.h>

#include <cmath>

#include "example.hpp"

namespace gantry {
namespace {

using example::kQuarter;

// At a quarter turn an eccentric moment of 100 N m and a wind of 30 N m drive the load, cables of 20 N m too.
PlantParams<double> loaded() {
  PlantParams<double> p = example::simple_plant();
  p.eccentric_moment_nm = 100.0;
  p.wind_moment_nm = 30.0;
  p.cable_moment_nm = 20.0;
  p.brake_torque_nm = 400.0;
  p.brake_presliding_rad = 1e-3;
  p.wind = p.cable = true;
  return p;
}

DriveParams<double> drive() {
  DriveParams<double> p;
  p.kvp_nm_s_per_rad = 2.0;
  p.torque_rated_nm = 100.0;
  p.torque_max_nm = 150.0;
  p.overload_time_s = 4.0;
  return p;
}

GantrySim<double> standing(const PlantParams<double>& p, double pos, bool servo_on) {
  GantrySim<double> sim(p, drive(), 0.0, 0.0, {1e-3, 125e-6, 8, Scheme::kOneEvaluation, 2});
  sim.static_start(pos, servo_on);
  return sim;
}

// Whatever was before: a brake on its way, an encoder that failed, scans that were counted.
TEST(Standstill, begins_anew) {
  GantrySim<double> sim = standing(loaded(), 0.1, true);
  sim.brake.countdown = 5.0;
  sim.scans_done = 7.0;
  sim.set_encoder_gain(0.0);
  sim.count_offset = 9.0;
  sim.x.roller_z = sim.s.vel_filtered = sim.s.overload = sim.report.vel = 1.0;
  sim.static_start(kQuarter, false);
  EXPECT_EQ(sim.x.roller_z, 0.0);
  EXPECT_EQ(sim.s.vel_filtered, 0.0);
  EXPECT_EQ(sim.overload(), 0.0);
  EXPECT_EQ(sim.vel_report(), 0.0);
  EXPECT_EQ(sim.brake.countdown, 0.0);
  EXPECT_EQ(sim.scans_done, 0.0);
  EXPECT_FALSE(sim.encoder.spoilt);
  EXPECT_EQ(sim.encoder.pos_start, 0.0);
  EXPECT_EQ(sim.encoder.seen_start, 0.0);
  EXPECT_EQ(sim.count_offset, 9.0);  // the encoder stays where it is mounted
}

TEST(Standstill, nothing_has_happened_before_it) {
  const GantrySim<double> sim(loaded(), drive(), 0.0, 0.0, {1e-3, 125e-6, 8, Scheme::kOneEvaluation, 2});
  EXPECT_EQ(sim.torque_mesh(), 0.0);
  EXPECT_EQ(sim.vel_report(), 0.0);
  EXPECT_FALSE(sim.limited());
  EXPECT_EQ(sim.scans_done, 0.0);
  EXPECT_EQ(sim.count_offset, 0.0);
  EXPECT_FALSE(sim.encoder.spoilt);
  EXPECT_TRUE(sim.brake.closed);
}

// 150 N m at the load are 15 N m of the motor against them.
TEST(Standstill, drive_or_brake_holds_what_drives_the_load) {
  PlantParams<double> p = loaded();
  p.rigid = p.base = true;  // and no base that could give way
  const GantrySim<double> on = standing(p, kQuarter, true);
  EXPECT_EQ(on.x.pos_base, 0.0);
  EXPECT_NEAR(on.report.torque_mesh, -150.0, 1e-9);
  EXPECT_NEAR(on.x.torque_motor, -15.0, 1e-9);
  EXPECT_NEAR(on.s.torque_set, -15.0, 1e-9);
  EXPECT_NEAR(on.s.integral, -7.5, 1e-9);
  EXPECT_NEAR(on.x.pos_motor, 10.0 * kQuarter, 1e-12);
  EXPECT_EQ(on.x.brake_z, 0.0);
  EXPECT_FALSE(on.brake.closed);
  EXPECT_NEAR(on.s.pos_last, 10.0 * kQuarter, 1e-12);
  const GantrySim<double> off = standing(p, kQuarter, false);
  EXPECT_EQ(off.x.torque_motor, 0.0);
  EXPECT_NEAR(off.x.brake_z, 15.0 / 4e5, 1e-12);
  EXPECT_TRUE(off.brake.closed);
}

// The spring of 0.045 rad at 150 N m - 10 to its first knee, 20 to its second, 120 beyond - and half the gap;
// the base gives way by 130 N m / 1300 N m/rad.
TEST(Standstill, gears_are_wound_up_by_what_they_carry) {
  PlantParams<double> p = loaded();
  p.half_backlash_rad = 0.002;
  p.backlash = true;
  const double twist = 0.01 + 0.01 + 0.03 + 0.002;
  EXPECT_NEAR(standing(p, kQuarter, true).x.pos_motor, 10.0 * (kQuarter - twist), 1e-9);
  p.eccentric_moment_nm = -100.0;
  p.wind_moment_nm = -30.0;
  p.cable_moment_nm = -20.0;
  EXPECT_NEAR(standing(p, kQuarter, true).x.pos_motor, 10.0 * (kQuarter + twist), 1e-9);
  p.base = true;
  p.base_stiffness_nm_per_rad = 1300.0;
  const GantrySim<double> rocked = standing(p, kQuarter, true);
  EXPECT_NEAR(rocked.x.pos_base, -0.1, 1e-12);
  EXPECT_NEAR(rocked.x.pos_motor, 10.0 * (kQuarter + 0.1 + twist), 1e-9);
  p.gear_error = true;  // of the ring against the base
  p.error_ring_rad[0] = 1e-3;
  EXPECT_NEAR(standing(p, kQuarter, true).x.pos_motor, 10.0 * (kQuarter + 0.1 + twist - 1e-3 * std::cos(0.1)),
              1e-9);
  p.gear_error = p.wind = p.cable = false;
  p.eccentric_moment_nm = 0.5;
  p.base_stiffness_nm_per_rad = 1e12;
  EXPECT_NEAR(standing(p, kQuarter, true).x.pos_motor, 10.0 * (kQuarter - 0.0025), 1e-9);
  p.eccentric_moment_nm = 0.0;  // in the middle of its gap
  EXPECT_NEAR(standing(p, kQuarter, true).x.pos_motor, 10.0 * kQuarter, 1e-9);
}

// 130 N m turn the base by 0.1 rad, and the ring with its cables by as much less: 100 N m for each rad of it.
TEST(Standstill, cables_pull_by_the_angle_against_the_base) {
  PlantParams<double> p = loaded();
  p.base = true;
  p.base_stiffness_nm_per_rad = 1300.0;
  p.cable_moment_nm = 0.0;
  p.cable_moment_1_nm = 100.0;
  EXPECT_NEAR(standing(p, kQuarter, true).report.torque_mesh, -130.0 - 100.0 * (kQuarter - 0.1), 1e-9);
}

// Half of 150 N m each: 0.02 rad to the second knee, 45 N m beyond it on 4000 N m/rad. The ring of the second
// is a quarter turn further on, half a turn and what the base gives way in all.
TEST(Standstill, a_second_motor_stands_where_its_place_on_the_ring_puts_it) {
  PlantParams<double> p = loaded();
  p.eccentric_moment_nm = -100.0;
  p.wind_moment_nm = -30.0;
  p.cable_moment_nm = -20.0;
  p.base = p.second_pinion = p.gear_error = true;
  p.base_stiffness_nm_per_rad = 1300.0;
  p.second_angle_rad = kQuarter;
  p.error_ring_rad[0] = 1e-3;
  p.phase_ring_rad[0] = 0.3;
  const GantrySim<double> sim = standing(p, kQuarter, true);
  const double wound = kQuarter + 0.1 + 0.02 + 45.0 / 4000.0;
  EXPECT_NEAR(sim.x.pos_motor, 10.0 * (wound - 1e-3 * std::cos(0.4)), 1e-9);
  EXPECT_NEAR(sim.x.pos_motor_2, 10.0 * (wound + 1e-3 * std::sin(0.4)), 1e-9);
}

// An error of the gears that is ahead of the load takes the motor back.
TEST(Standstill, motor_stands_where_the_errors_of_the_gears_put_it) {
  PlantParams<double> p = loaded();
  p.eccentric_moment_nm = p.wind_moment_nm = p.cable_moment_nm = 0.0;
  p.error_ring_rad[0] = 1e-3;
  EXPECT_NEAR(standing(p, kQuarter, true).x.pos_motor, 10.0 * kQuarter, 1e-12);
  p.gear_error = true;
  EXPECT_NEAR(standing(p, kQuarter, true).x.pos_motor, 10.0 * (kQuarter - 1e-3), 1e-12);
  p.gear_error = false;
  p.tooth_pitch = true;
  p.ring_teeth = 4;
  p.pinion_teeth = 2;
  p.reducer_ratio = 2.0;
  p.contact_ratio = 1.5;
  p.pitch.ring_rad[0] = p.pitch.ring_rad[1] = 2e-3;
  EXPECT_NEAR(standing(p, 0.6, true).x.pos_motor, 10.0 * (0.6 - 2e-3), 1e-12);
  p.pitch.pinion_rad[0] = p.pitch.pinion_rad[1] = 1e-3;
  EXPECT_NEAR(standing(p, 0.6, true).x.pos_motor, 10.0 * (0.6 - 3e-3), 1e-12);
}

// A quarter wave of cogging drives the motor by 1.5 N m; the drive gives as much less. A warm motor of 0.8 of
// its torque is asked for a quarter more.
TEST(Standstill, drive_gives_what_cogging_and_a_warm_motor_leave_to_it) {
  PlantParams<double> p = loaded();
  p.rigid = p.cogging = true;
  p.cogging_torque_nm = 1.5;
  p.cogging_order = 4;
  p.cogging_phase_rad = kQuarter - 4.0 * 10.0 * kQuarter;
  EXPECT_NEAR(standing(p, kQuarter, true).x.torque_motor, -16.5, 1e-6);
  p.cogging = false;
  p.thermal = true;
  p.torque_constant_per_k = -0.01;
  p.motor_temp_start_k = 20.0;
  EXPECT_NEAR(standing(p, kQuarter, true).x.torque_motor, -15.0 / 0.8, 1e-9);
  p.thermal = false;
  p.torque_constant = true;
  p.torque_constant_ratio = 0.5;
  EXPECT_NEAR(standing(p, kQuarter, true).x.torque_motor, -30.0, 1e-9);
}

TEST(Standstill, contacts_are_old_where_they_age) {
  PlantParams<double> p = loaded();
  EXPECT_EQ(standing(p, 0.0, true).x.roller_age, 0.0);
  p.ageing = true;
  EXPECT_EQ(standing(p, 0.0, true).x.roller_age, 1.0);
  EXPECT_EQ(standing(p, 0.0, true).x.motor_age, 1.0);
}

// What holds at rest goes on holding: in a second nothing moves by as much as a micrometre at 4 m.
TEST(Standstill, stays) {
  for (bool servo_on : {true, false}) {
    PlantParams<double> p = loaded();
    p.wind_moment_nm = 0.0;
    p.wind = false;
    GantrySim<double> sim = standing(p, kQuarter, servo_on);
    const double load = sim.x.pos_load;
    const DriveCommand<double> hold{servo_on ? DriveMode::kSpeed : DriveMode::kOff, 0.0, 0.0};
    for (int k = 0; k < 1000; ++k) sim.scan(hold, servo_on);
    EXPECT_NEAR(sim.x.pos_load, load, 2.5e-7);
  }
}

// Reported in fours of the counts of 1 mrad: 10.6 of them are 12, and 5 are added where the encoder is
// mounted.
TEST(Simulator, counts_in_its_own_resolution) {
  DriveParams<double> d = drive();
  d.position_count_rad = 4e-3;
  GantrySim<double> sim(loaded(), d, 0.0, 0.0, {1e-3, 125e-6, 8, Scheme::kOneEvaluation, 2});
  sim.count_offset = 5.0;
  sim.x.pos_motor = 10.6e-3;
  EXPECT_NEAR(sim.counts(1e-3), 17.0, 1e-9);
  sim.x.pos_motor = -10.6e-3;
  EXPECT_NEAR(sim.counts(1e-3), -7.0, 1e-9);
  GantrySim<double> ideal(loaded(), drive(), 0.0, 0.0, {1e-3, 125e-6, 8, Scheme::kOneEvaluation, 2});
  ideal.x.pos_motor = 10.6e-3;
  EXPECT_NEAR(ideal.counts(1e-3), 10.6, 1e-9);
}

// The account of 5 s: half of it is 0.5; a drive of no more than its rated torque has none.
TEST(Simulator, tells_the_used_part_of_its_overload) {
  GantrySim<double> sim = standing(loaded(), 0.0, true);
  sim.s.overload = 2.5;
  EXPECT_NEAR(sim.overload(), 0.5, 1e-12);
  DriveParams<double> small = drive();
  small.overload_time_s = 0.4;  // 0.5 s
  GantrySim<double> short_one(loaded(), small, 0.0, 0.0, sim.timing());
  short_one.s.overload = 0.25;
  EXPECT_NEAR(short_one.overload(), 0.5, 1e-12);
  DriveParams<double> d = drive();
  d.torque_max_nm = d.torque_rated_nm;
  GantrySim<double> none(loaded(), d, 0.0, 0.0, {1e-3, 125e-6, 8, Scheme::kOneEvaluation, 2});
  EXPECT_EQ(none.overload(), 0.0);
}

TEST(Simulator, says_of_each_scan_whether_the_torque_was_limited) {
  GantrySim<double> sim = standing(loaded(), 0.0, true);
  sim.scan({DriveMode::kSpeed, 1e6, 0.0}, true);
  EXPECT_TRUE(sim.limited());
  sim.scan({DriveMode::kOff, 0.0, 0.0}, true);
  EXPECT_FALSE(sim.limited());
  EXPECT_TRUE(sim.samples.empty());  // nobody has asked for any
}

// Load and base at 0.5 and 0.1 rad, turning with 3 and 1 rad/s, read 10 ms ago; the noise of reading 1 is
// that of load_encoder_test.cpp.
TEST(Simulator, reads_the_ring_against_the_base) {
  GantrySim<double> sim = standing(loaded(), 0.0, true);
  sim.x.pos_load = 0.5;
  sim.x.pos_base = 0.1;
  sim.x.vel_load = 3.0;
  sim.x.vel_base = 1.0;
  EXPECT_EQ(sim.ring_reading(), 0.0);
  sim.ring_encoder.fitted = true;
  EXPECT_NEAR(sim.ring_reading(), 0.4, 1e-12);
  sim.ring_encoder.latency_s = 0.01;
  EXPECT_NEAR(sim.ring_reading(), 0.38, 1e-12);
  const ScaleTerm<double> none;
  for (double each : {none.waves, none.amplitude_rad, none.phase_rad}) EXPECT_EQ(each, 0.0);
  sim.ring_encoder.scale[0].waves = 2.0;
  sim.ring_encoder.scale[0].amplitude_rad = 1.0;
  EXPECT_NEAR(sim.ring_reading(), 0.38 + std::sin(0.76), 1e-12);
  sim.ring_encoder.scale[0].amplitude_rad = 0.0;
  sim.ring_encoder.noise_rad = 1e-3;
  sim.scans_done = 1.0;
  EXPECT_NEAR(sim.ring_reading(), 0.38 - 1e-3 * 74702.0 / 37837.0, 1e-12);
}

// A shaft that turns at 2 rad/s, 2 mrad in a scan, is read 1 ms late. At 4 mrad its encoder begins to go
// backwards and jumps by half a radian: drive and reading see what it shows.
TEST(Simulator, shows_the_shaft_as_its_encoder_does) {
  PlantParams<double> p = loaded();
  p.wind = p.cable = false;
  p.eccentric_moment_nm = 0.0;
  p.rigid = true;
  DriveParams<double> d = drive();
  d.latency_s = 1e-3;
  GantrySim<double> sim(p, d, 0.0, 0.0, {1e-3, 125e-6, 8, Scheme::kOneEvaluation, 2});
  sim.static_start(0.0, true);
  sim.x.vel_motor = 2.0;
  const DriveCommand<double> off{DriveMode::kOff, 0.0, 0.0};
  sim.scan(off, true);
  EXPECT_NEAR(sim.vel_report(), -0.25, 1e-12);  // of the scan: 7 cycles of 0.25 mrad, 2 mrad behind the shaft
  sim.scan(off, true);
  EXPECT_NEAR(sim.vel_report(), 2.0, 1e-12);
  EXPECT_NEAR(sim.counts(1e-3), 2.0, 1e-9);
  EXPECT_EQ(sim.scans_done, 2.0);
  sim.set_encoder_gain(-1.0);
  sim.jump_encoder(0.5);
  sim.scan(off, true);
  EXPECT_NEAR(sim.counts(1e-3), 504.0, 1e-9);  // 504 - 2, and 2 mrad more 1 ms ago
  sim.scan(off, true);
  EXPECT_NEAR(sim.vel_report(), -2.0, 1e-9);
  EXPECT_NEAR(sim.s.pos_last, 0.50225, 1e-9);  // 504 - 4 + 2 mrad, one drive cycle ago
}

// 8 drive cycles in a scan, of which every second is kept: four, the last at the end of the scan.
TEST(Simulator, takes_samples_between_its_scans) {
  GantrySim<double> sim = standing(loaded(), 0.1, true);
  sim.sample_every = 2;
  for (int scan = 0; scan < 2; ++scan) {
    sim.scan({DriveMode::kSpeed, 1.0, 0.0}, true);
    ASSERT_EQ(sim.samples.size(), 4u);
    EXPECT_EQ(sim.samples[3].values[0], sim.x.pos_motor);
    EXPECT_EQ(sim.samples[3].values[3], sim.x.vel_load);
    EXPECT_EQ(sim.samples[3].values[5], 0.0);
    EXPECT_NE(sim.samples[2].values[0], sim.x.pos_motor);
  }
  sim.sample_every = 4;
  sim.scan({DriveMode::kOff, 0.0, 0.0}, false);  // the brake closes at once
  ASSERT_EQ(sim.samples.size(), 2u);
  EXPECT_EQ(sim.samples[1].values[0], sim.x.pos_motor);
  EXPECT_EQ(sim.samples[1].values[5], 1.0);
  sim.sample_every = 1;
  sim.scan({DriveMode::kOff, 0.0, 0.0}, false);
  EXPECT_EQ(sim.samples.size(), 8u);
  sim.static_start(0.2, true);
  EXPECT_TRUE(sim.samples.empty());  // there is no last scan
}

}  // namespace
}  // namespace gantry
