// The closed loop without Python: set-point sampling, position law, drive and plant, scan after scan. The
// scan engine calls the same functions one by one, so both give the same bits as long as no monitor acts.
#pragma once

#include <array>
#include <cmath>
#include <thread>
#include <vector>

#include "core/control/compensated_law.hpp"
#include "core/control/position_law.hpp"
#include "core/control/segments.hpp"
#include "core/plant/gantry_sim.hpp"

namespace gantry {

// clang-format off
// One row of a log: the state at the start of the scan, the set-point sampled and the command computed from them.
#define GANTRY_LOG_COLUMNS(X)                                                                             \
  X(pos_ref_rad) X(vel_ref_rad_s) X(acc_ref_rad_s2) X(pos_act_rad) X(pos_err_rad) X(vel_cmd_rad_s)        \
  X(torque_act_nm) X(pos_load_rad) X(vel_load_rad_s) X(pos_motor_rad) X(vel_motor_rad_s) X(pos_base_rad)  \
  X(vel_base_rad_s) X(torque_mesh_nm) X(counts) X(torque_limited) X(pos_ring_rad) X(torque_ff_nm)

// What is kept of a leg. mean_*: over its last scans; max_*: largest absolute value over the whole leg.
// Speed and position errors at the gantry against the set-point: motor side vel_motor/i, load side vel_load.
#define GANTRY_LEG_COLUMNS(X)                                                                             \
  X(mean_pos_load_rad) X(mean_pos_ring_rad) X(mean_pos_act_rad) X(max_vel_err_motor_rad_s)                \
  X(max_vel_err_load_rad_s) X(max_pos_err_motor_rad) X(max_pos_err_load_rad) X(max_torque_motor_nm)       \
  X(max_torque_mesh_nm)
// clang-format on

struct LogRow {
#define X(name) double name;
  GANTRY_LOG_COLUMNS(X)
#undef X
};

struct LegResult {
#define X(name) double name = 0.0;
  GANTRY_LEG_COLUMNS(X)
#undef X
};

// A stretch of a run: one plan, how many scans it lasts, and over how many of the last ones the readings are
// averaged.
struct Leg {
  Segments plan;
  long scans = 0;
  long average = 0;
};

// The state of the plant in a row; set-point and command are filled in by the caller.
inline LogRow state_row(const GantrySim<double>& sim) {
  LogRow row{};
  row.torque_act_nm = sim.x.torque_motor;
  row.pos_load_rad = sim.x.pos_load;
  row.vel_load_rad_s = sim.x.vel_load;
  row.pos_motor_rad = sim.x.pos_motor;
  row.vel_motor_rad_s = sim.x.vel_motor;
  row.pos_base_rad = sim.x.pos_base;
  row.vel_base_rad_s = sim.x.vel_base;
  row.torque_mesh_nm = sim.torque_mesh();
  row.torque_limited = sim.limited() ? 1.0 : 0.0;
  row.pos_ring_rad = sim.ring_reading();
  return row;
}

// How one axis of a run is controlled; `compensation` may be null.
struct Control {
  PositionLawParams law;
  double zero_counts = 0.0;
  Compensation<double>* compensation = nullptr;
  double torque_ff_nm = 0.0;  // on top of everything
};

// One scan: log the state at t, compute the command, advance by one period.
inline LogRow closed_loop_scan(GantrySim<double>& sim, const Control& control, const Segments& plan,
                               double t) {
  const PositionLawParams& law = control.law;
  LogRow row = state_row(sim);
  const SetPoint r = plan.sample(t);
  row.counts = sim.counts(law.rad_per_count) - control.zero_counts;
  row.torque_ff_nm = control.torque_ff_nm;
  PositionLawResult<double> command;
  if (Compensation<double>* c = control.compensation) {
    const auto result = compensated_law(law, c->p, c->s, r, row.counts, row.pos_ring_rad);
    command = result.law;
    row.torque_ff_nm += result.torque_ff_nm;
  } else {
    command = position_law(law, r.pos, r.vel, row.counts);
  }
  row.pos_ref_rad = r.pos;
  row.vel_ref_rad_s = r.vel;
  row.acc_ref_rad_s2 = r.acc;
  row.pos_act_rad = command.pos_act_rad;
  row.pos_err_rad = command.pos_err_rad;
  row.vel_cmd_rad_s = command.vel_cmd_rad_s;
  sim.scan({DriveMode::kSpeed, command.vel_cmd_rad_s, row.torque_ff_nm}, true);
  return row;
}

// Runs `scans` scans of one plan and hands every row to `sink`.
template <class Sink>
void run_plan(GantrySim<double>& sim, const Control& control, const Segments& plan, long scans, Sink&& sink) {
  const double period = sim.scan_period_s();
  for (long k = 0; k < scans; ++k)
    sink(k, closed_loop_scan(sim, control, plan, static_cast<double>(k) * period));
}

inline LegResult run_leg(GantrySim<double>& sim, const Control& control, const Leg& leg) {
  LegResult r;
  const auto largest = [](double& so_far, double x) { so_far = std::max(so_far, std::fabs(x)); };
  run_plan(sim, control, leg.plan, leg.scans, [&](long k, const LogRow& row) {
    largest(r.max_vel_err_motor_rad_s, row.vel_motor_rad_s / control.law.ratio - row.vel_ref_rad_s);
    largest(r.max_vel_err_load_rad_s, row.vel_load_rad_s - row.vel_ref_rad_s);
    largest(r.max_pos_err_motor_rad, row.pos_err_rad);
    largest(r.max_pos_err_load_rad, row.pos_ref_rad - row.pos_load_rad);
    largest(r.max_torque_motor_nm, row.torque_act_nm);
    largest(r.max_torque_mesh_nm, row.torque_mesh_nm);
    if (k < leg.scans - leg.average) return;
    r.mean_pos_load_rad += row.pos_load_rad;
    r.mean_pos_ring_rad += row.pos_load_rad - row.pos_base_rad;
    r.mean_pos_act_rad += row.pos_act_rad;
  });
  const double n = static_cast<double>(leg.average);
  r.mean_pos_load_rad /= n;
  r.mean_pos_ring_rad /= n;
  r.mean_pos_act_rad /= n;
  return r;
}

// Every plant through every leg; plants are shared out to threads, so the result does not depend on their
// number.
inline std::vector<std::vector<LegResult>> run_legs(std::vector<GantrySim<double>*> sims,
                                                    const std::vector<Control>& controls,
                                                    const std::vector<Leg>& legs, int threads) {
  std::vector<std::vector<LegResult>> results(sims.size());
  if (sims.empty()) return results;
  const std::size_t shares = std::min(sims.size(), static_cast<std::size_t>(threads));
  const auto work = [&](std::size_t first) {
    for (std::size_t n = first; n < sims.size(); n += shares)
      for (const Leg& leg : legs) results[n].push_back(run_leg(*sims[n], controls[n], leg));
  };
  std::vector<std::thread> pool;
  for (std::size_t k = 1; k < shares; ++k) pool.emplace_back(work, k);
  work(0);
  for (std::thread& t : pool) t.join();
  return results;
}

}  // namespace gantry
