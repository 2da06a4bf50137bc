// A batch over plants of any kind and several threads. Which thread takes which plant has no effect on it.
#pragma once

#include <atomic>
#include <map>
#include <thread>
#include <tuple>
#include <vector>

#include "core/isa/dispatch.hpp"

namespace gantry {

// Equal where two plants may share a pack.
inline auto group_key(const Job& job) {
  const GantrySim<double>& sim = *job.sim;
  const Timing& t = sim.timing();
  std::vector<int> switches = {sim.drive().p.delay_cycles,
                               t.cycles_per_scan,
                               static_cast<int>(t.scheme),
                               t.rk4_steps,
                               sim.ring_encoder.fitted,
                               sim.encoder.spoilt,
                               job.control.compensation != nullptr,
                               sim.drive().p.encoder_errors};
#define X(name, type, value, meaning) switches.push_back(sim.plant().p.name);
  GANTRY_PLANT_SWITCHES(X)
#undef X
  if (const Compensation<double>* c = job.control.compensation) {
#define X(name, meaning) switches.push_back(c->p.name);
    GANTRY_COMPENSATION_SWITCHES(X)
#undef X
  }
  return std::make_tuple(t.scan_period_s, t.cycle_s, switches);
}

// Every plant through every leg.
inline void run_jobs(const Kernels& kernels, const std::vector<Job>& jobs, int threads) {
  std::map<decltype(group_key(jobs[0])), std::vector<const Job*>> sorted;
  for (const Job& job : jobs) sorted[group_key(job)].push_back(&job);
  std::vector<std::atomic<std::size_t>> drawn(sorted.size());
  const auto work = [&] {
    auto counter = drawn.begin();
    for (const auto& [key, group] : sorted) kernels.run_group({group.data(), group.size(), &*counter++});
  };
  std::vector<std::thread> pool;
  for (int k = 1; k < threads && static_cast<std::size_t>(k) < jobs.size(); ++k) pool.emplace_back(work);
  work();
  for (std::thread& t : pool) t.join();
}

}  // namespace gantry
