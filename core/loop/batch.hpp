// Many plants through their legs, as many at once as a pack has lanes. Every lane goes its own way through
// the legs of its plant; when it is done the next plant takes its place. No lane ever sees another, so each
// plant has the bits that it has alone.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>

#include "core/lane/pack.hpp"
#include "core/loop/closed_loop.hpp"

namespace gantry::GANTRY_ISA {

// A plant, how it is controlled, where it goes, where the figures of each leg are put, and the rows of all
// legs one after the other. Either all jobs of a group have a log or none has; its columns are the same.
struct Job {
  GantrySim<double>* sim;
  Control<double> control;
  const Leg* legs;
  std::size_t leg_count;
  LegResult<double>* results;
  ColumnLog log = {};
};

// Plants that may share a pack: equal in every switch, timing and form of control. Threads draw from it.
struct JobGroup {
  const Job* const* jobs;
  std::size_t count;
  std::atomic<std::size_t>* drawn;

  const Job* draw() const {
    const std::size_t next = drawn->fetch_add(1, std::memory_order_relaxed);
    return next < count ? jobs[next] : nullptr;
  }
};

template <class T>
class Batch {
 public:
  // Until the group is exhausted; `first` is a job drawn from it.
  void run(const JobGroup& group, const Job* first) {
    begin(*first);
    for (int k = 0; k < kWidth; ++k) {
      const Job* job = k == 0 ? first : group.draw();
      load(k, job != nullptr ? *job : *first);
      if (job == nullptr) lanes_[k].job = nullptr;
    }
    build();
    while (advance(scans_to_next_event())) end_of_legs(group);
  }

 private:
  static constexpr int kWidth = kLanes<T>;

  struct Lane {
    const Job* job = nullptr;  // none: what the lane computes is not used
    std::size_t leg = 0;
    long scan = 0;        // of the leg
    std::size_t row = 0;  // of the log

    const Leg& now() const { return job->legs[leg]; }
    bool adding() const { return job != nullptr && !now().added_rad_s.empty(); }
    bool averaging() const { return job != nullptr && scan >= now().scans - now().average; }
  };

  // What is common to the plants of a group.
  void begin(const Job& job) {
    const PlantParams<double>& plant = job.sim->plant().p;
#define X(name, type, value, meaning) plant_.name = plant.name;
    GANTRY_PLANT_SWITCHES(X)
#undef X
    drive_.delay_cycles = job.sim->drive().p.delay_cycles;
    drive_.encoder_errors = job.sim->drive().p.encoder_errors;
    timing_ = job.sim->timing();
    sim_.ring_encoder.fitted = job.sim->ring_encoder.fitted;
    sim_.encoder.spoilt = job.sim->encoder.spoilt;
    kept_ = job.log;
    control_.compensation = nullptr;
    if (const Compensation<double>* c = job.control.compensation) {
      control_.compensation = &compensation_;
#define X(name, meaning) compensation_.p.name = c->p.name;
      GANTRY_COMPENSATION_SWITCHES(X)
#undef X
      CompensationParams<T>& p = compensation_.p;
      p.map.used = p.lost_motion.used = p.scale.used = p.fast_used = 0;  // grow with the plants that come
    }
  }

  void load(int k, const Job& job) {
    lanes_[k] = {&job, 0, 0, 0};
    const GantrySim<double>& one = *job.sim;
    load_parameters(k, one);
    load_state(k, one);
    load_control(k, job.control);
    begin_leg(k);
  }

  void load_parameters(int k, const GantrySim<double>& one) {
#define X(name, value, meaning) set_lane(plant_.name, k, one.plant().p.name);
    GANTRY_PLANT_PARAMS(X)
#undef X
    for (std::size_t n = 0; n < kRingHarmonics; ++n) {
      set_lane(plant_.error_ring_rad[n], k, one.plant().p.error_ring_rad[n]);
      set_lane(plant_.phase_ring_rad[n], k, one.plant().p.phase_ring_rad[n]);
    }
    for (std::size_t n = 0; n < kWindWaves; ++n) {
      set_lane(plant_.wind_wave_nm[n], k, one.plant().p.wind_wave_nm[n]);
      set_lane(plant_.wind_rate_rad_s[n], k, one.plant().p.wind_rate_rad_s[n]);
      set_lane(plant_.wind_phase_rad[n], k, one.plant().p.wind_phase_rad[n]);
    }
    if (plant_.tooth_pitch) set_tooth_pitch(plant_.pitch, k, one.plant().p.pitch);
#define X(name, value, meaning) set_lane(drive_.name, k, one.drive().p.name);
    GANTRY_DRIVE_PARAMS(X)
#undef X
    set_lane(close_cycles_, k, one.brake_close_cycles());
    set_lane(open_cycles_, k, one.brake_open_cycles());
    LoadEncoderParams<T>& ring = sim_.ring_encoder;
    set_lane(ring.step_rad, k, one.ring_encoder.step_rad);
    set_lane(ring.noise_rad, k, one.ring_encoder.noise_rad);
    set_lane(ring.latency_s, k, one.ring_encoder.latency_s);
    for (std::size_t n = 0; n < ring.scale.size(); ++n) {
      set_lane(ring.scale[n].waves, k, one.ring_encoder.scale[n].waves);
      set_lane(ring.scale[n].amplitude_rad, k, one.ring_encoder.scale[n].amplitude_rad);
      set_lane(ring.scale[n].phase_rad, k, one.ring_encoder.scale[n].phase_rad);
    }
  }

  void load_state(int k, const GantrySim<double>& one) {
#define X(name, ...) set_lane(sim_.x.name, k, one.x.name);
    GANTRY_PLANT_STATE(X)
    GANTRY_PLANT_EFFECT_STATE(X)
#undef X
#define X(name, meaning) set_lane(sim_.s.name, k, one.s.name);
    GANTRY_DRIVE_STATE(X)
#undef X
    set_lane(sim_.brake.closed, k, one.brake.closed);
    set_lane(sim_.brake.countdown, k, one.brake.countdown);
    set_lane(sim_.report.torque_mesh, k, one.report.torque_mesh);
    set_lane(sim_.report.vel, k, one.report.vel);
    set_lane(sim_.report.limited, k, one.report.limited);
    set_lane(sim_.encoder.gain, k, one.encoder.gain);
    set_lane(sim_.encoder.pos_start, k, one.encoder.pos_start);
    set_lane(sim_.encoder.seen_start, k, one.encoder.seen_start);
    set_lane(sim_.scans_done, k, one.scans_done);
    set_lane(sim_.count_offset, k, one.count_offset);
  }

  void load_control(int k, const Control<double>& one) {
    set_lane(control_.law.kpp_per_s, k, one.law.kpp_per_s);
    set_lane(control_.law.kvf, k, one.law.kvf);
    set_lane(control_.law.ratio, k, one.law.ratio);
    set_lane(control_.law.rad_per_count, k, one.law.rad_per_count);
    set_lane(control_.law.vel_max_rad_s, k, one.law.vel_max_rad_s);
    set_lane(control_.zero_counts, k, one.zero_counts);
    set_lane(control_.torque_ff_nm, k, one.torque_ff_nm);
    if (one.compensation != nullptr) load_compensation(k, *one.compensation);
  }

  void load_compensation(int k, const Compensation<double>& one) {
    CompensationParams<T>& p = compensation_.p;
#define X(name, value, meaning) set_lane(p.name, k, one.p.name);
    GANTRY_COMPENSATION_PARAMS(X)
#undef X
    load_harmonics(k, p.map, one.p.map);
    load_harmonics(k, p.lost_motion, one.p.lost_motion);
    load_harmonics(k, p.scale, one.p.scale);
    p.fast_used = std::max(p.fast_used, one.p.fast_used);
    for (std::size_t n = 0; n < p.fast.size(); ++n) {
      set_lane(p.fast[n].cycles, k, one.p.fast[n].cycles);
      set_lane(p.fast[n].sine, k, one.p.fast[n].sine);
      set_lane(p.fast[n].cosine, k, one.p.fast[n].cosine);
    }
#define X(name, meaning) set_lane(compensation_.s.name, k, one.s.name);
    GANTRY_COMPENSATION_STATE(X)
#undef X
    for (std::size_t n = 0; n < kLeadSums; ++n) set_lane(compensation_.s.lead_sums[n], k, one.s.lead_sums[n]);
    for (std::size_t n = 0; n < kBacklashModels; ++n) {
#define X(name, meaning) set_lane(compensation_.s.bank[n].name, k, one.s.bank[n].name);
      GANTRY_LOAD_MODEL_STATE(X)
#undef X
    }
    set_lane(compensation_.s.started, k, one.s.started);
  }

  template <int N>
  static void load_harmonics(int k, Harmonics<T, N>& pack, const Harmonics<double, N>& one) {
    pack.used = std::max(pack.used, one.used);
    set_lane(pack.mean, k, one.mean);
    for (std::size_t n = 0; n < N; ++n) {
      set_lane(pack.sine[n], k, one.sine[n]);
      set_lane(pack.cosine[n], k, one.cosine[n]);
    }
  }

  void build() { sim_.build(plant_, drive_, close_cycles_, open_cycles_, timing_); }

  void unload(int k) const {
    GantrySim<double>& one = *lanes_[k].job->sim;
#define X(name, ...) one.x.name = lane(sim_.x.name, k);
    GANTRY_PLANT_STATE(X)
    GANTRY_PLANT_EFFECT_STATE(X)
#undef X
#define X(name, meaning) one.s.name = lane(sim_.s.name, k);
    GANTRY_DRIVE_STATE(X)
#undef X
    one.brake.closed = lane(sim_.brake.closed, k);
    one.brake.countdown = lane(sim_.brake.countdown, k);
    one.report.torque_mesh = lane(sim_.report.torque_mesh, k);
    one.report.vel = lane(sim_.report.vel, k);
    one.report.limited = lane(sim_.report.limited, k);
    one.scans_done = lane(sim_.scans_done, k);
    Compensation<double>* c = lanes_[k].job->control.compensation;
    if (c == nullptr) return;
#define X(name, meaning) c->s.name = lane(compensation_.s.name, k);
    GANTRY_COMPENSATION_STATE(X)
#undef X
    for (std::size_t n = 0; n < kLeadSums; ++n) c->s.lead_sums[n] = lane(compensation_.s.lead_sums[n], k);
    for (std::size_t n = 0; n < kBacklashModels; ++n) {
#define X(name, meaning) c->s.bank[n].name = lane(compensation_.s.bank[n].name, k);
      GANTRY_LOAD_MODEL_STATE(X)
#undef X
    }
    c->s.started = lane(compensation_.s.started, k);
  }

  void begin_leg(int k) {
#define X(name) set_lane(figures_.name, k, 0.0);
    GANTRY_LEG_COLUMNS(X)
#undef X
    set_lane(start_motor_, k, lane(sim_.x.pos_motor, k));
    set_lane(start_load_, k, lane(sim_.x.pos_load, k));
    const Leg& leg = lanes_[k].now();
    set_lane(follows_, k, leg.mode == DriveMode::kSpeed);
    set_lane(off_, k, leg.mode == DriveMode::kOff);
    set_lane(quick_stop_, k, leg.mode == DriveMode::kQuickStop);
    set_lane(brake_open_, k, leg.brake_open);
    set_lane(adds_, k, !leg.added_rad_s.empty());
  }

  // Scans until a lane ends its leg or begins to average; 0: no lane has work.
  long scans_to_next_event() const {
    long least = 0;
    for (const Lane& l : lanes_) {
      if (l.job == nullptr) continue;
      const long start = l.now().scans - l.now().average;
      const long left = l.scan < start ? start - l.scan : l.now().scans - l.scan;
      if (least == 0 || left < least) least = left;
    }
    return least;
  }

  // Runs so many scans, in none of which anything begins or ends; false: there are none.
  bool advance(long scans) {
    if (scans == 0) return false;
    MaskOf<T> averaging = mask<T>(false);
    for (int k = 0; k < kWidth; ++k) set_lane(averaging, k, lanes_[k].averaging());
    const bool together = same_plan();
    const bool all_follow = !any(negate(follows_));
    bool adding = false;
    for (const Lane& l : lanes_) adding = adding || l.adding();
    for (long n = 0; n < scans; ++n) {
      sample(together);
      if (adding) sample_added();
      const LogRow<T> row = scan(all_follow, adding);
      if (kept_.data != nullptr) log(row);
      add(row, averaging);
      for (Lane& l : lanes_) {
        ++l.scan;
        ++l.row;
      }
    }
    return true;
  }

  LogRow<T> scan(bool all_follow, bool adding) {
    if (all_follow) return command(follow(sim_, control_, point_), adding);
    const CompensationState<T> before = compensation_.s;
    LogRow<T> row = follow(sim_, control_, point_);
    row.vel_ref_rad_s = select(follows_, row.vel_ref_rad_s, T(0.0));
    row.acc_ref_rad_s2 = select(follows_, row.acc_ref_rad_s2, T(0.0));
    row.pos_ref_rad = select(follows_, row.pos_ref_rad, row.pos_load_rad);
    row.pos_err_rad = select(follows_, row.pos_err_rad, T(0.0));
    row.vel_cmd_rad_s = select(follows_, row.vel_cmd_rad_s, T(0.0));
    row.torque_ff_nm = select(follows_, row.torque_ff_nm, T(0.0));
    CompensationState<T>& s = compensation_.s;
#define X(name, meaning) s.name = select(follows_, s.name, before.name);
    GANTRY_COMPENSATION_STATE(X)
#undef X
    for (std::size_t n = 0; n < kLeadSums; ++n)
      s.lead_sums[n] = select(follows_, s.lead_sums[n], before.lead_sums[n]);
    for (std::size_t n = 0; n < kBacklashModels; ++n) {
#define X(name, meaning) s.bank[n].name = select(follows_, s.bank[n].name, before.bank[n].name);
      GANTRY_LOAD_MODEL_STATE(X)
#undef X
    }
    s.started = either(both(follows_, s.started), both(negate(follows_), before.started));
    return command(row, adding);
  }

  GANTRY_INLINE LogRow<T> command(const LogRow<T>& row, bool adding) {
    DriveCommand<T> drive;
    drive.off = off_;
    drive.quick_stop = quick_stop_;
    drive.vel_cmd_rad_s = row.vel_cmd_rad_s;
    if (adding) drive.vel_cmd_rad_s = select(adds_, row.vel_cmd_rad_s + added_, row.vel_cmd_rad_s);
    drive.torque_ff_nm = row.torque_ff_nm;
    sim_.scan(drive, brake_open_);
    return row;
  }

  // All lanes that have work are at the same time of the same plan.
  bool same_plan() const {
    const Lane* first = nullptr;
    for (const Lane& l : lanes_) {
      if (l.job == nullptr) continue;
      if (first == nullptr) first = &l;
      if (&l.now() != &first->now() || l.scan != first->scan) return false;
    }
    return true;
  }

  // Set-points of this scan; a lane without work keeps its last.
  void sample(bool together) {
    for (int k = 0; k < kWidth; ++k) {
      const Lane& l = lanes_[k];
      if (l.job == nullptr) continue;
      const SetPoint<double> r =
          l.now().plan.sample(static_cast<double>(l.now().passed + l.scan) * timing_.scan_period_s);
      if (together) {
        point_ = {T(r.pos), T(r.vel), T(r.acc)};
        return;
      }
      set_lane(point_.pos, k, r.pos);
      set_lane(point_.vel, k, r.vel);
      set_lane(point_.acc, k, r.acc);
    }
  }

  // What is added to the speed commands of this scan.
  void sample_added() {
    for (int k = 0; k < kWidth; ++k) {
      if (!lanes_[k].adding()) continue;
      const std::vector<double>& added = lanes_[k].now().added_rad_s;
      set_lane(added_, k, added[static_cast<std::size_t>(lanes_[k].scan) % added.size()]);
    }
  }

  void log(const LogRow<T>& row) const {
    const T* const values = &row.pos_ref_rad;
    for (std::size_t c = 0; c < kept_.count; ++c)
      for (int k = 0; k < kWidth; ++k) {
        const Lane& l = lanes_[k];
        if (l.job == nullptr) continue;
        l.job->log.data[c * l.job->log.scans + l.row] = lane(values[kept_.columns[c]], k);
      }
  }

  // Figures of the legs, on the fly: nothing grows with the duration.
  GANTRY_INLINE void add(const LogRow<T>& row, MaskOf<T> averaging) {
    LegResult<T>& r = figures_;
    largest(r.max_vel_err_motor_rad_s, row.vel_motor_rad_s / control_.law.ratio - row.vel_ref_rad_s);
    largest(r.max_vel_err_load_rad_s, row.vel_load_rad_s - row.vel_ref_rad_s);
    largest(r.max_pos_err_motor_rad, row.pos_err_rad);
    largest(r.max_pos_err_load_rad, row.pos_ref_rad - row.pos_load_rad);
    largest(r.max_torque_motor_nm, row.torque_act_nm);
    largest(r.max_torque_mesh_nm, row.torque_mesh_nm);
    largest(r.max_travel_motor_rad, (row.pos_motor_rad - start_motor_) / control_.law.ratio);
    largest(r.max_travel_load_rad, row.pos_load_rad - start_load_);
    if (!any(averaging)) return;
    const auto sum = [averaging](T& so_far, T x) { so_far = select(averaging, so_far + x, so_far); };
    sum(r.mean_pos_load_rad, row.pos_load_rad);
    sum(r.mean_pos_ring_rad, row.pos_load_rad - row.pos_base_rad);
    sum(r.mean_pos_act_rad, row.pos_act_rad);
  }

  static GANTRY_INLINE void largest(T& so_far, T x) {
    const T size = vabs(x);
    so_far = select(size <= so_far, so_far, size);  // what is no number is taken
  }

  // Lanes at the end of a leg put down its figures and go on: to the next leg, or with the next plant.
  void end_of_legs(const JobGroup& group) {
    bool other_plants = false;
    for (int k = 0; k < kWidth; ++k) {
      Lane& l = lanes_[k];
      if (l.job == nullptr || l.scan < l.now().scans) continue;
      put_figures(k);
      l.scan = 0;
      if (++l.leg < l.job->leg_count) {
        begin_leg(k);
        continue;
      }
      unload(k);
      const Job* next = group.draw();
      if (next != nullptr) {
        load(k, *next);
        other_plants = true;
      } else {
        l.job = nullptr;
      }
    }
    if (other_plants) build();
  }

  void put_figures(int k) {
    const Lane& l = lanes_[k];
    LegResult<double>& r = l.job->results[l.leg];
#define X(name) r.name = lane(figures_.name, k);
    GANTRY_LEG_COLUMNS(X)
#undef X
    const double n = static_cast<double>(l.now().average);
    r.mean_pos_load_rad /= n;
    r.mean_pos_ring_rad /= n;
    r.mean_pos_act_rad /= n;
  }

  Lane lanes_[kWidth];
  PlantParams<T> plant_;
  DriveParams<T> drive_;
  T close_cycles_ = T(0.0);
  T open_cycles_ = T(0.0);
  Timing timing_;
  GantrySim<T> sim_;
  Compensation<T> compensation_;
  Control<T> control_;
  SetPoint<T> point_{T(0.0), T(0.0), T(0.0)};
  LegResult<T> figures_;
  T start_motor_ = T(0.0);  // where the leg began
  T start_load_ = T(0.0);
  MaskOf<T> follows_ = mask<T>(true);
  MaskOf<T> off_ = mask<T>(false);
  MaskOf<T> quick_stop_ = mask<T>(false);
  MaskOf<T> brake_open_ = mask<T>(true);
  MaskOf<T> adds_ = mask<T>(false);
  T added_ = T(0.0);
  ColumnLog kept_;  // that of one of the plants, for the columns
};

}  // namespace gantry::GANTRY_ISA
