#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <set>
#include <stdexcept>
#include <tuple>

#include "core/bindings.hpp"
#include "core/loop/closed_loop.hpp"

namespace nb = nanobind;
using namespace gantry;
using Sim = GantrySim<double>;
using Table = nb::ndarray<double, nb::numpy, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using Cube = nb::ndarray<nb::numpy, double, nb::ndim<3>>;

namespace {

constexpr std::size_t kLogColumns = sizeof(LogRow) / sizeof(double);

// Puts rows into a table with one row per log column, so that each column lies in one piece.
struct LogTable {
  explicit LogTable(const Table& out) : data(out.data()), scans(out.shape(1)) {
    if (out.shape(0) != kLogColumns) throw std::invalid_argument("out must have one row per log column");
  }
  void operator()(long k, const LogRow& row) const {
    double* to = data + k;
#define X(name)   \
  *to = row.name; \
  to += scans;
    GANTRY_LOG_COLUMNS(X)
#undef X
  }
  double* data;
  std::size_t scans;
};

void run_closed_loop(Sim& sim, const PositionLawParams& law, const Segments& plan, double zero_counts,
                     Table out, double torque_ff_nm, Compensation<double>* compensation) {
  const LogTable table(out);
  nb::gil_scoped_release release;
  run_plan(sim, {law, zero_counts, compensation, torque_ff_nm}, plan, static_cast<long>(table.scans), table);
}

void run_command(Sim& sim, int mode, double vel_cmd_rad_s, bool brake_open, Table out) {
  const LogTable table(out);
  const DriveCommand<double> command{drive_mode(mode), vel_cmd_rad_s, 0.0};
  nb::gil_scoped_release release;
  for (std::size_t k = 0; k < table.scans; ++k) {
    table(static_cast<long>(k), state_row(sim));
    sim.scan(command, brake_open);
  }
}

Cube run_legs_array(const std::vector<Sim*>& sims, const PositionLawParams& law,
                    const std::vector<std::tuple<Segments, long, long>>& legs,
                    const std::vector<double>& zero_counts, int threads,
                    const std::vector<Compensation<double>*>& compensations) {
  if (!compensations.empty() && compensations.size() != sims.size())
    throw std::invalid_argument("one compensation per plant is needed, or none at all");
  if (std::set<Compensation<double>*>(compensations.begin(), compensations.end()).size() !=
      compensations.size())
    throw std::invalid_argument("a compensation stands in the list twice; every plant needs its own");
  if (zero_counts.size() != sims.size()) throw std::invalid_argument("one zero offset per plant is needed");
  if (threads < 1) throw std::invalid_argument("threads must be at least 1");
  if (std::set<Sim*>(sims.begin(), sims.end()).size() != sims.size())
    throw std::invalid_argument("a plant stands in the list twice; take copies");
  std::vector<Leg> native;
  for (const auto& [plan, scans, average] : legs) {
    if (scans < 1 || average < 1 || average > scans)
      throw std::invalid_argument("a leg needs 1 <= average <= scans");
    native.push_back({plan, scans, average});
  }
  std::vector<Control> controls;
  for (std::size_t k = 0; k < sims.size(); ++k)
    controls.push_back({law, zero_counts[k], compensations.empty() ? nullptr : compensations[k], 0.0});
  std::vector<std::vector<LegResult>> results;
  {
    nb::gil_scoped_release release;
    results = run_legs(sims, controls, native, threads);
  }
  constexpr std::size_t kColumns = sizeof(LegResult) / sizeof(double);
  auto* data = new double[sims.size() * native.size() * kColumns + 1];
  nb::capsule owner(data, [](void* p) noexcept { delete[] static_cast<double*>(p); });
  double* to = data;
  for (const auto& plant : results)
    for (const LegResult& r : plant) {
#define X(name) *to++ = r.name;
      GANTRY_LEG_COLUMNS(X)
#undef X
    }
  return Cube(data, {sims.size(), native.size(), kColumns}, owner);
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
  m.def("run_command", &run_command, nb::arg("sim"), nb::arg("mode"), nb::arg("vel_cmd_rad_s"),
        nb::arg("brake_open"), nb::arg("out"),
        "Run out.shape[1] scans with one command to the drive (mode 0 off, 1 speed, 2 quick stop); log the "
        "state.");
  m.def("run_legs", &run_legs_array, nb::arg("sims"), nb::arg("law"), nb::arg("legs"), nb::arg("zero_counts"),
        nb::arg("threads") = 1, nb::arg("compensations") = std::vector<Compensation<double>*>(),
        "Every plant through every leg (plan, scans, scans to average at its end).\n\n"
        "Returns an array [plant, leg, LEG_COLUMNS]; plants are shared out to threads without any effect on "
        "the result.");
}
