// The closed loop without Python: set-point sampling, position law, drive and plant, scan after scan. The
// scan engine calls the same functions one by one, so both give the same bits as long as no monitor acts.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "core/control/compensated_law.hpp"
#include "core/control/position_law.hpp"
#include "core/control/segments.hpp"
#include "core/plant/gantry_sim.hpp"

namespace gantry::GANTRY_ISA {

// clang-format off
// One row of a log: the state at the start of the scan, the set-point sampled and the command computed from them.
#define GANTRY_LOG_COLUMNS(X)                                                                             \
  X(pos_ref_rad) X(vel_ref_rad_s) X(acc_ref_rad_s2) X(pos_act_rad) X(pos_err_rad) X(vel_cmd_rad_s)        \
  X(torque_act_nm) X(pos_load_rad) X(vel_load_rad_s) X(pos_motor_rad) X(vel_motor_rad_s) X(pos_base_rad)  \
  X(vel_base_rad_s) X(torque_mesh_nm) X(counts) X(torque_limited) X(pos_ring_rad) X(torque_ff_nm)         \
  X(vel_report_rad_s)

// What is kept of a leg. mean_*: over its last scans; max_*: largest absolute value over the whole leg.
// Speed and position errors at the gantry against the set-point: motor side vel_motor/i, load side vel_load. Under a
// command to the drive the speed set-point is 0 and there is no position error. max_travel_*: way from where the leg
// began, motor side at the gantry.
#define GANTRY_LEG_COLUMNS(X)                                                                             \
  X(mean_pos_load_rad) X(mean_pos_ring_rad) X(mean_pos_act_rad) X(max_vel_err_motor_rad_s)                \
  X(max_vel_err_load_rad_s) X(max_pos_err_motor_rad) X(max_pos_err_load_rad) X(max_torque_motor_nm)       \
  X(max_torque_mesh_nm) X(max_travel_motor_rad) X(max_travel_load_rad)
// clang-format on

template <class T>
struct LogRow {
#define X(name) T name = T(0.0);
  GANTRY_LOG_COLUMNS(X)
#undef X
};

template <class T>
struct LegResult {
#define X(name) T name = T(0.0);
  GANTRY_LEG_COLUMNS(X)
#undef X
};

// A stretch of a run: one plan, how many scans it lasts, and over how many of the last ones the readings are
// averaged. With another mode than kSpeed the drive has that command and nobody follows the plan.
struct Leg {
  Segments plan;
  long scans = 0;
  long average = 0;
  DriveMode mode = DriveMode::kSpeed;
  bool brake_open = true;
  long passed = 0;                       // scans of the plan before the leg begins
  std::vector<double> added_rad_s = {};  // to the speed command, scan by scan and over again; empty: nothing
};

// How one axis of a run is controlled; `compensation` may be null.
template <class T>
struct Control {
  PositionLawParams<T> law;
  T zero_counts = T(0.0);
  Compensation<T>* compensation = nullptr;
  T torque_ff_nm = T(0.0);  // on top of everything
};

// The state of the plant in a row; set-point and command are filled in by the caller.
template <class T>
GANTRY_INLINE LogRow<T> state_row(const GantrySim<T>& sim) {
  LogRow<T> row;
  row.torque_act_nm = sim.torque_act();
  row.pos_load_rad = sim.x.pos_load;
  row.vel_load_rad_s = sim.x.vel_load;
  row.pos_motor_rad = sim.x.pos_motor;
  row.vel_motor_rad_s = sim.x.vel_motor;
  row.pos_base_rad = sim.x.pos_base;
  row.vel_base_rad_s = sim.x.vel_base;
  row.torque_mesh_nm = sim.torque_mesh();
  row.torque_limited = select(sim.limited(), T(1.0), T(0.0));
  row.pos_ring_rad = sim.ring_reading();
  row.vel_report_rad_s = sim.vel_report();
  return row;
}

// The state, and the command that follows the set-point.
template <class T>
GANTRY_INLINE LogRow<T> follow(const GantrySim<T>& sim, const Control<T>& control, const SetPoint<T>& r) {
  const PositionLawParams<T>& law = control.law;
  LogRow<T> row = state_row(sim);
  row.counts = sim.counts(law.rad_per_count) - control.zero_counts;
  row.torque_ff_nm = control.torque_ff_nm;
  PositionLawResult<T> command;
  if (Compensation<T>* c = control.compensation) {
    const auto result = compensated_law(law, c->p, c->s, r, row.counts, row.pos_ring_rad, row.torque_act_nm);
    command = result.law;
    row.torque_ff_nm = row.torque_ff_nm + result.torque_ff_nm;
  } else {
    command = position_law(law, r.pos, r.vel, row.counts);
  }
  row.pos_ref_rad = r.pos;
  row.vel_ref_rad_s = r.vel;
  row.acc_ref_rad_s2 = r.acc;
  row.pos_act_rad = command.pos_act_rad;
  row.pos_err_rad = command.pos_err_rad;
  row.vel_cmd_rad_s = command.vel_cmd_rad_s;
  return row;
}

// One scan: that, and one period of the plant.
template <class T>
GANTRY_INLINE LogRow<T> closed_loop_scan(GantrySim<T>& sim, const Control<T>& control, const SetPoint<T>& r) {
  const LogRow<T> row = follow(sim, control, r);
  sim.scan({DriveMode::kSpeed, row.vel_cmd_rad_s, row.torque_ff_nm}, mask<T>(true));
  return row;
}

// Where rows go: one piece of memory per log column, `scans` long.
struct LogTable {
  double* data;
  std::size_t scans;

  GANTRY_INLINE void put(std::size_t k, const LogRow<double>& row) const {
    double* to = data + k;
#define X(name)   \
  *to = row.name; \
  to += scans;
    GANTRY_LOG_COLUMNS(X)
#undef X
  }
};

// The same for chosen columns, in the order of their numbers in `columns`; without memory nothing is kept.
struct ColumnLog {
  double* data = nullptr;
  std::size_t scans = 0;
  const int* columns = nullptr;
  std::size_t count = 0;
};

// Runs one plan for as many scans as the table is long.
inline void run_plan(GantrySim<double>& sim, const Control<double>& control, const Segments& plan,
                     const LogTable& table) {
  for (std::size_t k = 0; k < table.scans; ++k)
    table.put(k, closed_loop_scan(sim, control, plan.sample(static_cast<double>(k) * sim.scan_period_s())));
}

// The same with one command to the drive.
inline void run_command(GantrySim<double>& sim, const DriveCommand<double>& command, bool brake_open,
                        const LogTable& table) {
  for (std::size_t k = 0; k < table.scans; ++k) {
    table.put(k, state_row(sim));
    sim.scan(command, brake_open);
  }
}

}  // namespace gantry::GANTRY_ISA
