// One axis under the position law as WebAssembly: plant, drive and law of the Python module, compiled from
// the same headers, so that a page without a network draws what the program would. Built by
// tools/build_wasm.py.
//
// Numbers go in by `names()`, one a line, `name[n]` for an array, into `numbers()`; `stand` begins a run,
// `run` takes it through a plan and returns its log, column after column in the order of `columns()`.
#include <cmath>
#include <vector>

#include "core/loop/closed_loop.hpp"

using namespace gantry;

namespace {

static_assert(kRingHarmonics == 12 && kWindWaves == 24 && kRingTeethMax == 1024 && kPinionTeethMax == 128,
              "the lengths in kNames");

const char kNames[] =
#define X(name, value, meaning) "plant." #name "\n"
    GANTRY_PLANT_PARAMS(X)
#undef X
        "plant.error_ring_rad[12]\nplant.phase_ring_rad[12]\n"
        "plant.wind_wave_nm[24]\nplant.wind_rate_rad_s[24]\nplant.wind_phase_rad[24]\n"
        "plant.ring_pitch_rad[1024]\nplant.pinion_pitch_rad[128]\nplant.second_pinion_pitch_rad[128]\n"
#define X(name, type, value, meaning) "plant." #name "\n"
    GANTRY_PLANT_SWITCHES(X)
#undef X
#define X(name, value, meaning) "drive." #name "\n"
        GANTRY_DRIVE_PARAMS(X)
#undef X
            "drive.encoder_errors\ndrive.delay_cycles\n"
            "law.kpp_per_s\nlaw.kvf\nlaw.ratio\nlaw.rad_per_count\nlaw.vel_max_rad_s\n"
            "scan_period_s\nrk4_steps\ncount_offset\n";

const char kColumns[] =
#define X(name) #name "\n"
    GANTRY_LOG_COLUMNS(X)
#undef X
    ;

constexpr std::size_t kNumbersMost = 2048;
constexpr std::size_t kColumnCount = sizeof(LogRow<double>) / sizeof(double);

double given[kNumbersMost];
GantrySim<double> sim;
Control<double> control;
std::vector<double> plan_numbers, rows;

// The numbers one after the other, in the order of kNames.
class Reader {
 public:
  void read(double& to) { to = *next_++; }
  void read(int& to) { to = static_cast<int>(*next_++); }
  void read(bool& to) { to = *next_++ != 0.0; }
  template <class T, std::size_t N>
  void read(std::array<T, N>& to) {
    for (T& each : to) read(each);
  }

 private:
  const double* next_ = given;
};

// Drive cycles in a time, to the nearest.
int cycles(double time_s, double cycle_s) { return static_cast<int>(std::floor(time_s / cycle_s + 0.5)); }

}  // namespace

extern "C" {

const char* names() { return kNames; }
const char* columns() { return kColumns; }
double* numbers() { return given; }

// Standing still at an angle with the servo on, the encoder zeroed so that the load is where the set-point
// says. rk4_steps 0: one evaluation of the forces in a drive cycle.
void stand(double angle_rad) {
  Reader from;
  PlantParams<double> plant;
  DriveParams<double> drive;
  double scan_period_s = 0.0;
  int rk4_steps = 0;
#define X(name, value, meaning) from.read(plant.name);
  GANTRY_PLANT_PARAMS(X)
#undef X
  from.read(plant.error_ring_rad);
  from.read(plant.phase_ring_rad);
  from.read(plant.wind_wave_nm);
  from.read(plant.wind_rate_rad_s);
  from.read(plant.wind_phase_rad);
  from.read(plant.pitch.ring_rad);
  from.read(plant.pitch.pinion_rad);
  from.read(plant.pitch.second_pinion_rad);
#define X(name, type, value, meaning) from.read(plant.name);
  GANTRY_PLANT_SWITCHES(X)
#undef X
#define X(name, value, meaning) from.read(drive.name);
  GANTRY_DRIVE_PARAMS(X)
#undef X
  from.read(drive.encoder_errors);
  from.read(drive.delay_cycles);
  control = Control<double>();
  from.read(control.law.kpp_per_s);
  from.read(control.law.kvf);
  from.read(control.law.ratio);
  from.read(control.law.rad_per_count);
  from.read(control.law.vel_max_rad_s);
  from.read(scan_period_s);
  from.read(rk4_steps);
  const Scheme scheme = rk4_steps > 0 ? Scheme::kRungeKutta4 : Scheme::kOneEvaluation;
  sim = GantrySim<double>(
      plant, drive, cycles(drive.brake_close_s, drive.cycle_s), cycles(drive.brake_open_s, drive.cycle_s),
      {scan_period_s, drive.cycle_s, cycles(scan_period_s, drive.cycle_s), scheme, rk4_steps});
  from.read(sim.count_offset);
  sim.static_start(angle_rad, true);
  const PositionLawParams<double>& law = control.law;
  control.zero_counts =
      std::nearbyint(sim.counts(law.rad_per_count) - law.ratio * angle_rad / law.rad_per_count);
}

// Room for so many segments of a plan: time at their start, angle, speed, acceleration, jerk.
double* segments(int count) {
  plan_numbers.resize(5 * static_cast<std::size_t>(count));
  return plan_numbers.data();
}

// So many scans of that plan; its log.
const double* run(double duration_s, double pos_end_rad, double vel_end_rad_s, int scans) {
  std::vector<Segments::Segment> made;
  for (std::size_t k = 0; k < plan_numbers.size(); k += 5)
    made.push_back({plan_numbers[k], plan_numbers[k + 1], plan_numbers[k + 2], plan_numbers[k + 3],
                    plan_numbers[k + 4]});
  const Segments plan(made, duration_s, pos_end_rad, vel_end_rad_s);
  const auto length = static_cast<std::size_t>(scans);
  rows.resize(kColumnCount * length);
  run_plan(sim, control, plan, {rows.data(), length});
  return rows.data();
}
}
