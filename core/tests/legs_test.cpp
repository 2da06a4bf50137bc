// Many plants through many legs. Whatever the instruction set, the threads and the plants beside it, each has
// the bits that it has alone, scan after scan.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstring>

#include "core/loop/threads.hpp"
#include "example.hpp"

namespace gantry {
namespace {

constexpr double kAcc = 0.0069;

// Columns that are logged, not in their order: speed report, torque, load, set-point, command of the law,
// acceleration of the set-point, mesh, limited.
const std::vector<int> kLogged = {18, 6, 7, 0, 5, 2, 13, 15};

// Plants as different as a population may be: in switches, scheme, delay, encoders, brakes and control.
struct Population {
  std::vector<GantrySim<double>> sims;
  std::vector<Compensation<double>> compensations;
  std::vector<Control<double>> controls;
  std::vector<std::vector<Leg>> legs;
  std::vector<std::vector<LegResult<double>>> results;
  std::vector<std::vector<double>> logs;  // per plant, one chosen column after the other

  explicit Population(std::size_t plants) {
    std::mt19937 random(21);
    compensations.resize(plants);
    for (std::size_t k = 0; k < plants; ++k) {
      PlantParams<double> plant = example::varied(example::plant(), random);
      DriveParams<double> drive = example::varied(example::drive(), random);
      if (k % 5 == 3) plant.backlash = plant.ripple = false;
      if (k % 11 == 9) plant.rigid = true;
      if (k % 7 == 5) drive.delay_cycles = 0;
      if (k % 4 == 3) plant = example::beyond(plant);
      if (k % 5 == 4 && !plant.rigid) plant = example::on_two_pinions(plant, static_cast<int>(k / 5) % 3);
      drive.encoder_errors = k % 8 == 3;
      const Scheme scheme = k % 13 == 11 ? Scheme::kRungeKutta4 : Scheme::kOneEvaluation;
      GantrySim<double> sim = example::sim(plant, drive, scheme);
      if (k % 3 == 1) fit_ring_encoder(sim, static_cast<double>(k));
      sim.static_start(0.1 * static_cast<double>(k), k % 4 != 2);
      sim.count_offset = 3.0 * static_cast<double>(k);
      sim.report.limited = k % 2 == 0;                                     // in the scan before
      if (k % 8 == 2) sim.brake.countdown = 7.0 + static_cast<double>(k);  // its brake has begun to open
      if (k % 9 == 4 || k % 9 == 6) sim.set_encoder_gain(k % 2 == 0 ? 0.9 : 1.1);
      if (k % 9 == 6) sim.jump_encoder(1e-4 * static_cast<double>(k));
      sims.push_back(sim);
      legs.push_back(legs_of(static_cast<double>(k), static_cast<long>(k)));
      if (k % 3 == 1) compensate(compensations[k], static_cast<double>(k));
      if (k % 6 == 4) observe(compensations[k].p, static_cast<double>(k));
      if (k % 12 == 4) compensations[k].p.load_encoder = false;  // by the motor alone
      if (k % 6 == 4) remember(compensations[k].s, static_cast<double>(k));
      // A law that nobody has followed yet has not begun when its axis stops first.
      if (k % 12 == 1) std::swap(legs[k][0], legs[k][2]);
    }
    for (std::size_t k = 0; k < plants; ++k) {
      PositionLawParams<double> law = example::law();
      law.kpp_per_s += 0.1 * static_cast<double>(k);
      const double zero = std::round(sims[k].counts(example::kFineCount) - 100.0 * static_cast<double>(k));
      controls.push_back({law, zero, k % 3 == 1 ? &compensations[k] : nullptr, 0.1 * static_cast<double>(k)});
      results.emplace_back(legs[k].size());
      logs.emplace_back(kLogged.size() * scans_of(k));
    }
  }

  static void fit_ring_encoder(GantrySim<double>& sim, double k) {
    sim.ring_encoder.fitted = true;
    sim.ring_encoder.step_rad = k > 5.0 ? 1e-7 : 0.0;
    sim.ring_encoder.noise_rad = 1e-7 * k;
    sim.ring_encoder.latency_s = 1e-4;
    sim.ring_encoder.scale[0] = {2.0, 1e-6 * k, 0.3};
    if (k > 5.0) sim.ring_encoder.scale[1] = {37.0, 1e-6, k};
  }

  static void compensate(Compensation<double>& c, double k) {
    CompensationParams<double>& p = c.p;
    p.gear_map = p.windup = p.reversal = p.load_encoder = p.damping = p.torque_acceleration = true;
    p.map.sine[0] = 1e-5 * k;
    p.lost_motion.mean = 1e-6 * k;
    p.fast[0] = {338.0, 1e-6, 2e-6};
    p.inertia_kg_m2 = 2.6e6;
    p.torque_limit_nm = 20.0;
    p.moment_sine_nm = 1.6e4;
    p.compliance_rad_per_nm = 1e-9;
    p.pos_limit_rad = p.encoder_limit_rad = 1e-3;
    p.encoder_gain_per_s = 1.0;
    p.swing_speed_max_rad_s = 0.02;
    p.damping_gain = 0.02;
    p.swing_rad_s = 12.0;
    p.damping_filter = 0.2;
    p.damping_slow = 1e-3;
  }

  // Moment and backlash followed, errors of the scale taken off; other waves are in use than in the maps of
  // others.
  static void observe(CompensationParams<double>& p, double k) {
    p.moment_observer = p.backlash_observer = p.scale_map = true;
    p.map.used = 3;
    p.lost_motion.used = 2;
    p.lost_motion.sine[1] = p.lost_motion.cosine[1] = 1e-6;
    const bool few = static_cast<int>(k) % 5 == 1;  // the last plant of one pack, the first of another
    p.scale.used = few ? 2 : 5;
    p.scale.sine[1] = 1e-6 * k;
    p.scale.cosine[4] = few ? 0.0 : 1e-6;
    p.fast_used = few ? 1 : 4;
    if (!few) p.fast[3] = {26.0, 1e-6, 3e-6};
    p.inertia_load_kg_m2 = 2.18e6;
    p.windup_per_acc_s2 = 4e-3;
    p.friction_nm = 1e4;
    p.friction_load_nm = 6e3;
    p.friction_load_ratio = 0.1;
    p.friction_spread_nm = 6e3;
    p.moment_limit_nm = 3e4;
    p.observer_speed_rad_s = 1e-4;
    p.observer_weight = 1e-9 * k;
    p.observer_rate = 1e-3;
    p.backlash_step_rad = 1e-5;
    p.backlash_memory = 0.999;
    p.backlash_fast = 0.05;
    p.backlash_slow = 0.003;
  }

  // A law that goes on: what was seen of moment and lost motion before, and the moment is known.
  static void remember(CompensationState<double>& s, double k) {
    s.started = true;
    s.bias_rad = 1e-7 * k;
    s.info_sine = s.info_cosine = s.info_friction = 1e3 + k;
    for (std::size_t n = 0; n < kLeadSums; ++n) s.lead_sums[n] = 1.0 + 0.1 * k + static_cast<double>(n);
    for (std::size_t n = 0; n < kBacklashModels; ++n) s.bank[n].misfit = 0.1 * k + static_cast<double>(n);
  }

  // At constant speed, where an encoder on the ring tells the lost motion; the way of the move before.
  static Segments cruise(double from) { return {{{0.0, from, -1e-3, 0.0, 0.0}}, 1.0, from - 1e-3, -1e-3}; }

  // Other plans and other lengths for every plant: the lanes of a pack never end together. Some go on with a
  // plan that has begun, and some have a signal on their command.
  static std::vector<Leg> legs_of(double k, long scans) {
    const double from = 0.1 * k;
    std::vector<Leg> all = {{example::triangle(from, 0.0002 + 1e-5 * k, kAcc), 80 + 3 * scans, 20},
                            {example::triangle(from + 0.0002, -0.0003, kAcc), 60 + scans % 4, 1},
                            stop(from, scans),
                            {example::triangle(from, 0.0, kAcc), 5, 5},
                            {cruise(from), 30, 2}};
    all[0].passed = scans % 5;
    if (scans % 3 == 0) all[1].added_rad_s = {3.0, -2.0, 1.0 + k};
    return all;
  }

  std::size_t scans_of(std::size_t k) const {
    std::size_t all = 0;
    for (const Leg& leg : legs[k]) all += static_cast<std::size_t>(leg.scans);
    return all;
  }

  static Leg stop(double from, long scans) {
    const DriveMode modes[] = {DriveMode::kSpeed, DriveMode::kQuickStop, DriveMode::kOff};
    const Segments plan = scans % 2 == 0 ? cruise(from) : example::triangle(from, 1e-5, kAcc);
    return {plan, 190 + scans % 7, 3, modes[scans % 3], scans % 3 < 2};
  }

  std::vector<Job> jobs(bool logging = true) {
    std::vector<Job> all;
    for (std::size_t k = 0; k < sims.size(); ++k)
      all.push_back({&sims[k], controls[k], legs[k].data(), legs[k].size(), results[k].data()});
    if (logging)
      for (std::size_t k = 0; k < sims.size(); ++k)
        all[k].log = {logs[k].data(), scans_of(k), kLogged.data(), kLogged.size()};
    return all;
  }

  // The same by hand: one plant after the other, scan after scan, in the baseline.
  void run_alone() {
    for (std::size_t k = 0; k < sims.size(); ++k) {
      std::vector<LogRow<double>> rows;
      for (std::size_t leg = 0; leg < legs[k].size(); ++leg)
        results[k][leg] = run_leg(sims[k], controls[k], legs[k][leg], rows);
      for (std::size_t c = 0; c < kLogged.size(); ++c)
        for (std::size_t n = 0; n < rows.size(); ++n)
          logs[k][c * rows.size() + n] = (&rows[n].pos_ref_rad)[kLogged[c]];
    }
  }

  static LegResult<double> run_leg(GantrySim<double>& sim, const Control<double>& control, const Leg& leg,
                                   std::vector<LogRow<double>>& rows) {
    LegResult<double> r;
    const double start_motor = sim.x.pos_motor, start_load = sim.x.pos_load;
    const auto largest = [](double& so_far, double x) { so_far = std::max(so_far, std::fabs(x)); };
    for (long k = 0; k < leg.scans; ++k) {
      const bool follows = leg.mode == DriveMode::kSpeed;
      const auto point = leg.plan.sample(static_cast<double>(leg.passed + k) * sim.scan_period_s());
      const Compensation<double> before =
          control.compensation != nullptr ? *control.compensation : Compensation<double>();
      LogRow<double> row = follow(sim, control, point);
      if (!follows) {
        row.vel_ref_rad_s = row.acc_ref_rad_s2 = row.pos_err_rad = row.torque_ff_nm = row.vel_cmd_rad_s = 0.0;
        row.pos_ref_rad = row.pos_load_rad;
        if (control.compensation != nullptr) *control.compensation = before;
      }
      rows.push_back(row);
      double command = row.vel_cmd_rad_s;
      if (!leg.added_rad_s.empty())
        command += leg.added_rad_s[static_cast<std::size_t>(k) % leg.added_rad_s.size()];
      sim.scan({leg.mode, command, row.torque_ff_nm}, leg.brake_open);
      largest(r.max_travel_motor_rad, (row.pos_motor_rad - start_motor) / control.law.ratio);
      largest(r.max_travel_load_rad, row.pos_load_rad - start_load);
      largest(r.max_vel_err_motor_rad_s, row.vel_motor_rad_s / control.law.ratio - row.vel_ref_rad_s);
      largest(r.max_vel_err_load_rad_s, row.vel_load_rad_s - row.vel_ref_rad_s);
      largest(r.max_pos_err_motor_rad, row.pos_err_rad);
      largest(r.max_pos_err_load_rad, row.pos_ref_rad - row.pos_load_rad);
      largest(r.max_torque_motor_nm, row.torque_act_nm);
      largest(r.max_torque_mesh_nm, row.torque_mesh_nm);
      if (k < leg.scans - leg.average) continue;
      r.mean_pos_load_rad += row.pos_load_rad;
      r.mean_pos_ring_rad += row.pos_load_rad - row.pos_base_rad;
      r.mean_pos_act_rad += row.pos_act_rad;
    }
    const double n = static_cast<double>(leg.average);
    r.mean_pos_load_rad /= n;
    r.mean_pos_ring_rad /= n;
    r.mean_pos_act_rad /= n;
    return r;
  }
};

void expect_bits(double a, double b, const char* name, std::size_t plant) {
  EXPECT_EQ(std::memcmp(&a, &b, sizeof a), 0) << name << ", plant " << plant << ": " << a << " " << b;
}

// Figures, rows and everything that a plant goes on from.
void expect_same(const Population& a, const Population& b) {
  for (std::size_t k = 0; k < a.sims.size(); ++k) {
    EXPECT_EQ(std::memcmp(a.logs[k].data(), b.logs[k].data(), a.logs[k].size() * sizeof(double)), 0)
        << "log, plant " << k;
    for (std::size_t leg = 0; leg < a.legs[k].size(); ++leg) {
#define X(name) expect_bits(a.results[k][leg].name, b.results[k][leg].name, #name, k);
      GANTRY_LEG_COLUMNS(X)
#undef X
    }
#define X(name, ...) expect_bits(a.sims[k].x.name, b.sims[k].x.name, #name, k);
    GANTRY_PLANT_STATE(X)
    GANTRY_PLANT_EFFECT_STATE(X)
#undef X
#define X(name, meaning) expect_bits(a.sims[k].s.name, b.sims[k].s.name, #name, k);
    GANTRY_DRIVE_STATE(X)
#undef X
#define X(name, meaning) expect_bits(a.compensations[k].s.name, b.compensations[k].s.name, #name, k);
    GANTRY_COMPENSATION_STATE(X)
#undef X
    for (std::size_t n = 0; n < kBacklashModels; ++n) {
#define X(name, meaning) \
  expect_bits(a.compensations[k].s.bank[n].name, b.compensations[k].s.bank[n].name, #name, k);
      GANTRY_LOAD_MODEL_STATE(X)
#undef X
    }
    for (std::size_t n = 0; n < kLeadSums; ++n)
      expect_bits(a.compensations[k].s.lead_sums[n], b.compensations[k].s.lead_sums[n], "lead_sums", k);
    EXPECT_EQ(a.compensations[k].s.started, b.compensations[k].s.started);
    EXPECT_EQ(a.sims[k].brake.closed, b.sims[k].brake.closed);
    expect_bits(a.sims[k].brake.countdown, b.sims[k].brake.countdown, "brake countdown", k);
    expect_bits(a.sims[k].torque_mesh(), b.sims[k].torque_mesh(), "torque_mesh", k);
    expect_bits(a.sims[k].vel_report(), b.sims[k].vel_report(), "vel_report", k);
    expect_bits(a.sims[k].scans_done, b.sims[k].scans_done, "scans_done", k);
    EXPECT_EQ(a.sims[k].limited(), b.sims[k].limited());
  }
}

TEST(RunJobs, gives_every_plant_the_bits_that_it_has_alone) {
  constexpr std::size_t kPlants = 60;
  Population alone(kPlants);
  alone.run_alone();
  EXPECT_NE(alone.results[0][0].max_torque_motor_nm, alone.results[7][0].max_torque_motor_nm);
  // Some have learned from a leg that they followed at constant speed.
  const Population fresh(kPlants);
  std::size_t learned = 0;
  for (std::size_t k = 0; k < kPlants; ++k)
    learned += alone.compensations[k].s.lead_sums[0] != fresh.compensations[k].s.lead_sums[0];
  EXPECT_GT(learned, 0u);
  for (const Kernels* kernels : supported_kernels())
    for (int threads : {1, 3}) {
      SCOPED_TRACE(kernels->name);
      Population batch(kPlants);
      run_jobs(*kernels, batch.jobs(), threads);
      expect_same(alone, batch);
    }
}

TEST(RunJobs, has_the_same_figures_without_a_log) {
  Population with(19), without(19);
  run_jobs(kernels(), with.jobs(), 2);
  run_jobs(kernels(), without.jobs(false), 2);
  for (std::size_t k = 0; k < with.sims.size(); ++k) without.logs[k] = with.logs[k];
  expect_same(with, without);
}

TEST(RunJobs, takes_any_number_of_plants) {
  Population alone(19);
  alone.run_alone();
  for (std::size_t plants : {0u, 1u, 2u, 9u, 19u}) {
    Population batch(plants);
    run_jobs(kernels(), batch.jobs(), 2);
    expect_same(batch, alone);
  }
}

// A plant that begins where another has ended is behind those beside it on the same plan.
TEST(RunJobs, gives_plants_at_different_times_of_one_plan_their_own_set_points) {
  const Segments plan = example::triangle(0.0, 0.0002, kAcc);
  const std::vector<Leg> legs = {{plan, 40, 1}, {plan, 10, 1}};
  const GantrySim<double> start = Population(1).sims[0];
  for (const Kernels* kernels : supported_kernels()) {
    std::vector<GantrySim<double>> sims(21, start);
    std::vector<LegResult<double>> figures(sims.size());
    std::vector<Job> jobs;
    for (std::size_t k = 0; k < sims.size(); ++k)
      jobs.push_back({&sims[k], {example::law()}, &legs[k == 1 ? 1 : 0], 1, &figures[k]});
    run_jobs(*kernels, {jobs[0]}, 1);
    run_jobs(*kernels, {jobs.begin() + 1, jobs.end()}, 1);
    EXPECT_GT(figures[0].max_travel_load_rad, 0.0);
    for (std::size_t k = 2; k < sims.size(); ++k) {
      expect_bits(figures[0].max_pos_err_motor_rad, figures[k].max_pos_err_motor_rad, kernels->name, k);
      expect_bits(figures[0].mean_pos_load_rad, figures[k].mean_pos_load_rad, kernels->name, k);
    }
  }
}

// Each thread asks each group of plants once for work.
TEST(RunJobs, has_as_many_threads_as_are_asked_for_and_no_more_than_plants) {
  static std::atomic<int> asked;
  Kernels counting = kernels();
  counting.run_group = [](const JobGroup&) { ++asked; };
  Population one(1);
  struct Row {
    int threads;
    std::size_t plants;
    int expected;
  };
  for (const Row& row :
       {Row{0, 5, 1}, Row{1, 5, 1}, Row{2, 5, 2}, Row{3, 5, 3}, Row{8, 5, 5}, Row{3, 1, 1}}) {
    asked = 0;
    run_jobs(counting, std::vector<Job>(row.plants, one.jobs()[0]), row.threads);
    EXPECT_EQ(asked.load(), row.expected) << row.threads << " threads, " << row.plants << " plants";
  }
}

TEST(Leg, follows_its_plan_from_the_start_with_the_brake_open) {
  const Leg leg{};
  EXPECT_EQ(leg.scans, 0);
  EXPECT_EQ(leg.average, 0);
  EXPECT_EQ(leg.passed, 0);
  EXPECT_EQ(leg.mode, DriveMode::kSpeed);
  EXPECT_TRUE(leg.brake_open);
  EXPECT_TRUE(leg.added_rad_s.empty());
  EXPECT_EQ(Control<double>().zero_counts, 0.0);
}

// Nobody follows a plan while the drive has a command of its own: there is no set-point but where the load
// is.
TEST(Leg, under_a_command_to_the_drive_asks_for_nothing) {
  constexpr std::size_t kScans = 20;
  const std::vector<int> columns = {0, 1, 2, 4, 5, 7, 17};
  for (DriveMode mode : {DriveMode::kOff, DriveMode::kQuickStop}) {
    GantrySim<double> sim = Population(1).sims[0];
    std::vector<double> rows(kScans * columns.size());
    const Leg leg{example::triangle(0.3, 0.1, kAcc), kScans, 1, mode, false};
    LegResult<double> figures;
    const Job job{&sim,     {example::law(), 0.0, nullptr, 3.0},
                  &leg,     1,
                  &figures, {rows.data(), kScans, columns.data(), columns.size()}};
    run_jobs(kernels(), {job}, 1);
    for (std::size_t k = 0; k < kScans; ++k) {
      EXPECT_EQ(rows[k], rows[5 * kScans + k]);  // angle: that of the load
      for (std::size_t c : {1, 2, 3, 4, 6}) EXPECT_EQ(rows[c * kScans + k], 0.0) << columns[c];
    }
    EXPECT_EQ(figures.max_pos_err_motor_rad, 0.0);
  }
}

// A largest value that leaves out what is no number would tell that it has stood still.
TEST(Leg, of_a_plant_without_numbers_has_no_figures) {
  GantrySim<double> sim = Population(1).sims[0];
  sim.x.vel_load = std::nan("");
  const Leg leg{example::triangle(0.0, 0.1, kAcc), 30, 1};
  LegResult<double> figures;
  run_jobs(kernels(), {{&sim, {example::law()}, &leg, 1, &figures}}, 1);
  EXPECT_TRUE(std::isnan(figures.max_travel_load_rad));
  EXPECT_TRUE(std::isnan(figures.max_vel_err_load_rad_s));
  EXPECT_TRUE(std::isnan(figures.max_torque_mesh_nm));
  EXPECT_TRUE(std::isnan(figures.mean_pos_load_rad));
}

TEST(LogRow, shows_the_state_of_its_plant) {
  GantrySim<double> sim = example::sim();
  sim.x.pos_motor = 1.0;
  sim.x.vel_motor = 2.0;
  sim.x.pos_load = 3.0;
  sim.x.vel_load = 4.0;
  sim.x.pos_base = 5.0;
  sim.x.vel_base = 6.0;
  sim.x.torque_motor = 7.0;
  sim.report.torque_mesh = 8.0;
  sim.report.vel = 9.0;
  sim.report.limited = true;
  sim.ring_encoder.fitted = true;
  const LogRow<double> row = state_row(sim);
  EXPECT_EQ(row.pos_motor_rad, 1.0);
  EXPECT_EQ(row.vel_motor_rad_s, 2.0);
  EXPECT_EQ(row.pos_load_rad, 3.0);
  EXPECT_EQ(row.vel_load_rad_s, 4.0);
  EXPECT_EQ(row.pos_base_rad, 5.0);
  EXPECT_EQ(row.vel_base_rad_s, 6.0);
  EXPECT_EQ(row.torque_act_nm, 7.0);
  EXPECT_EQ(row.torque_mesh_nm, 8.0);
  EXPECT_EQ(row.vel_report_rad_s, 9.0);
  EXPECT_EQ(row.torque_limited, 1.0);
  EXPECT_EQ(row.pos_ring_rad, -2.0);
  EXPECT_EQ(row.counts, 0.0);
  sim.report.limited = false;
  EXPECT_EQ(state_row(sim).torque_limited, 0.0);
}

TEST(LogRow, shows_its_set_point_and_what_the_law_makes_of_it) {
  const GantrySim<double> sim = example::sim();  // the motor at 0
  const Control<double> control{{10.0, 0.5, 100.0, 1e-3, 1e3}, 2000.0};
  const LogRow<double> row = follow(sim, control, {0.1, 0.2, 0.3});
  EXPECT_EQ(row.pos_ref_rad, 0.1);
  EXPECT_EQ(row.vel_ref_rad_s, 0.2);
  EXPECT_EQ(row.acc_ref_rad_s2, 0.3);
  EXPECT_EQ(row.counts, -2000.0);
  EXPECT_NEAR(row.pos_act_rad, -0.02, 1e-12);  // 2 rad of the motor through 100
  EXPECT_NEAR(row.pos_err_rad, 0.12, 1e-12);
  EXPECT_NEAR(row.vel_cmd_rad_s, 120.0 + 10.0, 1e-9);  // 10 x 12 rad and half of 20 rad/s
}

// 1144 N m of eccentric moment are 1 N m of the motor, and 3 N m are given beside it.
TEST(LogRow, shows_a_torque_that_is_given_beside_the_compensation) {
  const GantrySim<double> sim = example::sim();
  Compensation<double> c;
  c.p.torque_eccentric = true;
  c.p.moment_sine_nm = example::kRatio;
  c.p.torque_limit_nm = 20.0;
  const Control<double> control{example::law(), 0.0, &c, 3.0};
  EXPECT_EQ(follow(sim, control, {0.0, 0.0, 0.0}).torque_ff_nm, 3.0);  // it begins here
  EXPECT_NEAR(follow(sim, control, {example::kQuarter, 0.0, 0.0}).torque_ff_nm, 4.0, 1e-12);
}

// The entry points for one plant, over the instruction sets.
TEST(Kernels, scan_and_run_with_the_same_bits) {
  constexpr std::size_t kScans = 300;
  constexpr std::size_t kColumns = sizeof(LogRow<double>) / sizeof(double);
  std::vector<std::vector<double>> tables;
  for (const Kernels* kernels : supported_kernels()) {
    Population one(2);
    GantrySim<double>& sim = one.sims[1];
    std::vector<double> rows(2 * kScans * kColumns);
    kernels->run_plan(sim, one.controls[1], one.legs[1][0].plan, {rows.data(), kScans});
    kernels->run_command(sim, {DriveMode::kQuickStop, 0.0, 0.0}, false,
                         {rows.data() + kScans * kColumns, kScans});
    for (int k = 0; k < 100; ++k) {
      kernels->scan(sim, {DriveMode::kSpeed, 3.0, 1.0}, k > 20);
      rows.push_back(sim.x.pos_load);
    }
    tables.push_back(rows);
  }
  for (const auto& rows : tables)
    EXPECT_EQ(std::memcmp(rows.data(), tables[0].data(), rows.size() * sizeof(double)), 0);
}

#if defined(__x86_64__)
// The compiler's run-time library asks the processor in code of its own.
TEST(Kernels, are_those_of_this_processor) {
  std::vector<std::string> names = {"baseline"};
  if (__builtin_cpu_supports("avx2")) names.emplace_back("avx2");
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl"))
    names.emplace_back("avx512");
  std::vector<std::string> found;
  for (const Kernels* kernels : supported_kernels()) found.emplace_back(kernels->name);
  EXPECT_EQ(found, names);
}
#endif

TEST(RunCommand, is_scan_after_scan_of_one_command) {
  constexpr std::size_t kScans = 50;
  GantrySim<double> sim = Population(1).sims[0], by_hand = sim;
  const DriveCommand<double> command{DriveMode::kSpeed, 2.0, 1.0};
  std::vector<double> rows(kScans * sizeof(LogRow<double>) / sizeof(double));
  run_command(sim, command, true, {rows.data(), kScans});
  for (std::size_t k = 0; k < kScans; ++k) {
    EXPECT_EQ(rows[7 * kScans + k], by_hand.x.pos_load);
    by_hand.scan(command, true);
  }
  EXPECT_EQ(sim.x.pos_load, by_hand.x.pos_load);
  EXPECT_NE(sim.x.pos_load, rows[7 * kScans]);
}

TEST(RunPlan, is_scan_after_scan_of_the_same_functions) {
  constexpr std::size_t kScans = 300;
  GantrySim<double> sim = Population(1).sims[0], by_hand = sim;
  const double zero = std::round(sim.counts(example::kFineCount));
  const PositionLawParams<double> law = example::law();
  const Segments plan = example::triangle(0.0, 0.0002, kAcc);
  std::vector<double> rows(kScans * sizeof(LogRow<double>) / sizeof(double));
  run_plan(sim, {law, zero}, plan, {rows.data(), kScans});
  for (std::size_t k = 0; k < kScans; ++k) {
    const auto r = plan.sample(static_cast<double>(k) * 1e-3);
    const auto c = position_law(law, r.pos, r.vel, by_hand.counts(law.rad_per_count) - zero);
    EXPECT_EQ(rows[k], r.pos);
    EXPECT_EQ(rows[5 * kScans + k], c.vel_cmd_rad_s);
    EXPECT_EQ(rows[7 * kScans + k], by_hand.x.pos_load);
    by_hand.scan({DriveMode::kSpeed, c.vel_cmd_rad_s, 0.0}, true);
  }
  EXPECT_EQ(sim.x.pos_load, by_hand.x.pos_load);
  EXPECT_EQ(sim.s.integral, by_hand.s.integral);
}

}  // namespace
}  // namespace gantry
