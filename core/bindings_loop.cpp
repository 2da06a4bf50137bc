#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <set>
#include <stdexcept>
#include <string>
#include <tuple>

#include "core/bindings.hpp"
#include "core/lane/counted.hpp"
#include "core/loop/threads.hpp"

namespace nb = nanobind;
using namespace gantry;
using Sim = GantrySim<double>;
using Law = PositionLawParams<double>;
using Table = nb::ndarray<double, nb::numpy, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Cube = nb::ndarray<nb::numpy, double, nb::ndim<3>>;
using Rows = nb::ndarray<nb::numpy, double, nb::ndim<2>>;

namespace {

constexpr std::size_t kLogColumns = sizeof(LogRow<double>) / sizeof(double);
constexpr std::size_t kLegColumns = sizeof(LegResult<double>) / sizeof(double);

LogTable log_table(const Table& out) {
  if (out.shape(0) != kLogColumns) throw std::invalid_argument("out must have one row per log column");
  return {out.data(), out.shape(1)};
}

void run_closed_loop(Sim& sim, const Law& law, const Segments& plan, double zero_counts, Table out,
                     double torque_ff_nm, Compensation<double>* compensation) {
  const LogTable table = log_table(out);
  nb::gil_scoped_release release;
  kernels().run_plan(sim, {law, zero_counts, compensation, torque_ff_nm}, plan, table);
}

void run_drive_command(Sim& sim, int mode, double vel_cmd_rad_s, bool brake_open, Table out) {
  const LogTable table = log_table(out);
  const DriveCommand<double> command{drive_mode(mode), vel_cmd_rad_s, 0.0};
  nb::gil_scoped_release release;
  kernels().run_command(sim, command, brake_open, table);
}

template <class T>
void expect_distinct(const std::vector<T*>& given, const char* message) {
  if (std::set<T*>(given.begin(), given.end()).size() != given.size()) throw std::invalid_argument(message);
}

// One for every plant, or one for all.
template <class T>
const T& of_plant(const std::vector<T>& given, std::size_t plant) {
  return given[given.size() == 1 ? 0 : plant];
}

using LegTuples = std::vector<std::tuple<Segments, long, long, int, bool, long, std::vector<double>>>;

std::vector<Leg> make_legs(const LegTuples& given) {
  std::vector<Leg> legs;
  for (const auto& [plan, scans, average, mode, brake_open, passed, added] : given) {
    if (scans < 1 || average < 1 || average > scans)
      throw std::invalid_argument("a leg needs 1 <= average <= scans");
    if (passed < 0) throw std::invalid_argument("a leg cannot begin before its plan");
    legs.push_back({plan, scans, average, drive_mode(mode), brake_open, passed, added});
  }
  return legs;
}

// Legs of every plant, or of all, and jobs over them.
struct LegRuns {
  std::vector<std::vector<Leg>> legs;
  std::vector<Job> jobs;

  std::size_t leg_count() const { return legs[0].size(); }
};

LegRuns make_runs(const std::vector<Sim*>& sims, const std::vector<Law>& laws,
                  const std::vector<LegTuples>& legs, const std::vector<double>& zero_counts, int threads,
                  const std::vector<Compensation<double>*>& compensations) {
  const std::size_t plants = sims.size();
  if (plants == 0) throw std::invalid_argument("no plant is given; a run needs at least one");
  if (std::count(sims.begin(), sims.end(), nullptr) != 0)
    throw std::invalid_argument("a plant of the list is None; give one for each run");
  if (laws.size() != 1 && laws.size() != plants)
    throw std::invalid_argument("one position law for all is needed, or one per plant");
  if (legs.size() != 1 && legs.size() != plants)
    throw std::invalid_argument("one list of legs for all is needed, or one per plant");
  if (!compensations.empty() && compensations.size() != plants)
    throw std::invalid_argument("one compensation per plant is needed, or none at all");
  expect_distinct(compensations, "a compensation stands in the list twice; every plant needs its own");
  if (zero_counts.size() != plants) throw std::invalid_argument("one zero offset per plant is needed");
  if (threads < 1) throw std::invalid_argument("threads must be at least 1");
  expect_distinct(sims, "a plant stands in the list twice; take copies");
  LegRuns runs;
  for (const LegTuples& given : legs) {
    runs.legs.push_back(make_legs(given));
    if (given.size() != legs[0].size()) throw std::invalid_argument("every plant needs as many legs");
  }
  if (runs.leg_count() > 0)
    for (std::size_t k = 0; k < plants; ++k)
      runs.jobs.push_back(
          {sims[k],
           {of_plant(laws, k), zero_counts[k], compensations.empty() ? nullptr : compensations[k]},
           of_plant(runs.legs, k).data(),
           runs.leg_count(),
           nullptr});
  return runs;
}

Cube run_legs(const std::vector<Sim*>& sims, const std::vector<Law>& laws, const std::vector<LegTuples>& legs,
              const std::vector<double>& zero_counts, int threads,
              const std::vector<Compensation<double>*>& compensations) {
  LegRuns runs = make_runs(sims, laws, legs, zero_counts, threads, compensations);
  const std::size_t leg_count = runs.leg_count();
  auto* results = new LegResult<double>[sims.size() * leg_count + 1];
  nb::capsule owner(results, [](void* p) noexcept { delete[] static_cast<LegResult<double>*>(p); });
  for (std::size_t k = 0; k < runs.jobs.size(); ++k) runs.jobs[k].results = results + k * leg_count;
  {
    nb::gil_scoped_release release;
    run_jobs(kernels(), runs.jobs, threads);
  }
  return Cube(&results->mean_pos_load_rad, {sims.size(), leg_count, kLegColumns}, owner);
}

std::vector<Rows> log_legs(const std::vector<Sim*>& sims, const std::vector<Law>& laws,
                           const std::vector<LegTuples>& legs, const std::vector<double>& zero_counts,
                           const std::vector<int>& columns, int threads,
                           const std::vector<Compensation<double>*>& compensations) {
  for (int column : columns)
    if (column < 0 || static_cast<std::size_t>(column) >= kLogColumns)
      throw std::invalid_argument("there is no log column " + std::to_string(column));
  LegRuns runs = make_runs(sims, laws, legs, zero_counts, threads, compensations);
  std::vector<LegResult<double>> results(runs.leg_count());
  std::vector<std::vector<LegResult<double>>> figures(runs.jobs.size(), results);
  std::vector<Rows> logs;
  for (std::size_t k = 0; k < runs.jobs.size(); ++k) {
    Job& job = runs.jobs[k];
    std::size_t scans = 0;
    for (const Leg& leg : of_plant(runs.legs, k)) scans += static_cast<std::size_t>(leg.scans);
    auto* rows = new double[scans * columns.size() + 1];
    nb::capsule owner(rows, [](void* p) noexcept { delete[] static_cast<double*>(p); });
    logs.push_back(Rows(rows, {columns.size(), scans}, owner));
    job.results = figures[k].data();
    job.log = {rows, scans, columns.data(), columns.size()};
  }
  {
    nb::gil_scoped_release release;
    run_jobs(kernels(), runs.jobs, threads);
  }
  return logs;
}

using Counts = std::tuple<double, double, double, double>;

// The same plan with a number that counts; the plant given stays as it is.
Counts count_operations(const Sim& sim, const Law& law, const Segments& plan, double zero_counts,
                        long scans) {
  if (scans < 1) throw std::invalid_argument("scans must be at least 1");
  Sim copy = sim;
  const Leg leg{plan, scans, 1};
  LegResult<double> result;
  const Job job{&copy, {law, zero_counts}, &leg, 1, &result};
  const Job* const jobs[] = {&job};
  std::atomic<std::size_t> drawn{1};
  operations = Operations();
  Batch<Counted>().run({jobs, 1, &drawn}, &job);
  const double cycles = static_cast<double>(scans) * sim.timing().cycles_per_scan;
  return {operations.add / cycles, operations.multiply / cycles, operations.divide / cycles,
          operations.choose / cycles};
}

}  // namespace

void bind_loop(nb::module_& m) {
#define X(name) #name,
  m.attr("LOG_COLUMNS") = nb::cast(std::vector<std::string>{GANTRY_LOG_COLUMNS(X)});
  m.attr("LEG_COLUMNS") = nb::cast(std::vector<std::string>{GANTRY_LEG_COLUMNS(X)});
#undef X
  m.def("run_closed_loop", &run_closed_loop, nb::arg("sim"), nb::arg("law"), nb::arg("plan"),
        nb::arg("zero_counts"), nb::arg("out"), nb::arg("torque_ff_nm") = 0.0,
        nb::arg("compensation") = nb::none(),
        "Run out.shape[1] scans of one plan, enabled and with the brake open; fill one row of `out` per log "
        "column.\n\n"
        "The same laws and physics as the scan engine, so the same bits; the plant in `sim` moves on.");
  m.def("run_command", &run_drive_command, nb::arg("sim"), nb::arg("mode"), nb::arg("vel_cmd_rad_s"),
        nb::arg("brake_open"), nb::arg("out"),
        "Run out.shape[1] scans with one command to the drive (mode 0 off, 1 speed, 2 quick stop); log the "
        "state.");
  m.def("run_legs", &run_legs, nb::arg("sims"), nb::arg("laws"), nb::arg("legs"), nb::arg("zero_counts"),
        nb::arg("threads") = 1, nb::arg("compensations") = std::vector<Compensation<double>*>(),
        "Every plant through its legs (plan, scans, scans to average at its end, mode, brake open, scans of "
        "the plan "
        "that have passed, speeds to add), several at once.\n"
        "mode: 1 follows the plan, 0 (off) and 2 (quick stop) are commands to the drive. Speeds to add, "
        "rad/s at the motor: to the command of the law, one a scan and over again.\n\n"
        "laws, legs: one for all plants or one for each, with the same number of legs. Returns an array "
        "[plant, leg, LEG_COLUMNS]. Each plant has the bits that it has alone, whatever the threads and the "
        "instruction set.");
  m.def("log_legs", &log_legs, nb::arg("sims"), nb::arg("laws"), nb::arg("legs"), nb::arg("zero_counts"),
        nb::arg("columns"), nb::arg("threads") = 1,
        nb::arg("compensations") = std::vector<Compensation<double>*>(),
        "The same, keeping rows: an array [column, scan] per plant, its legs one after the other. columns: "
        "numbers in LOG_COLUMNS. vel_cmd_rad_s is the command of the law, without what is added.");
  m.def("count_operations", &count_operations, nb::arg("sim"), nb::arg("law"), nb::arg("plan"),
        nb::arg("zero_counts"), nb::arg("scans"),
        "Additions, multiplications, divisions, and comparisons with choices per drive cycle, over a plan; "
        "everything counted that the loop does.");
  m.def(
      "arithmetic", [](long rounds) { return kernels().arithmetic(rounds); }, nb::arg("rounds"),
      "Do additions and multiplications as fast as this processor can without fusing them; returns how "
      "many.");
}
