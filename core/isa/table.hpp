// The table of one instruction set; GANTRY_ISA and GANTRY_ISA_LANES are defined by the source that includes
// it.
#pragma once

#include "core/isa/kernels.hpp"
#include "core/lane/twin.hpp"

#define GANTRY_TEXT_OF(name) #name
#define GANTRY_TEXT(name) GANTRY_TEXT_OF(name)

namespace gantry::GANTRY_ISA {

inline void scan(GantrySim<double>& sim, const DriveCommand<double>& command, bool brake_open) {
  sim.scan(command, brake_open);
}

// One plant alone is run as a number: packs of copies would take longer. Two packs at a time, for one alone
// waits for its own results: 12 to 25 % faster with either AVX (gcc 12).
inline void run_group(const JobGroup& group) {
  const Job* first = group.draw();
  if (first == nullptr) return;
  if (group.count == 1)
    Batch<double>().run(group, first);
  else
    Batch<Twin<Pack<GANTRY_ISA_LANES>>>().run(group, first);
}

// As many additions and multiplications as the processor can do, half and half, none waiting for another:
// what a kernel without fused multiply-add can reach at most. Returns their number.
inline long arithmetic(long rounds) {
  constexpr int kChains = GANTRY_ISA_LANES == 8 ? 12 : 7;  // of each kind: as many as the registers hold
  using P = Pack<GANTRY_ISA_LANES>;
  P sums[kChains], products[kChains];
  for (int k = 0; k < kChains; ++k) sums[k] = products[k] = P(1.0 + k);
  const P step(1e-9), factor(1.0 - 1e-9);
  for (long n = 0; n < rounds; ++n)
    for (int k = 0; k < kChains; ++k) {
      sums[k] = sums[k] + step;
      products[k] = products[k] * factor;
    }
  P all(0.0);
  for (int k = 0; k < kChains; ++k) all = all + sums[k] * products[k];
  return all.lane[0] == 0.0 ? 0 : 2 * kChains * GANTRY_ISA_LANES * rounds;
}

constexpr Kernels kTable = {
    GANTRY_TEXT(GANTRY_ISA), GANTRY_ISA_LANES, scan, run_plan, run_command, run_group, arithmetic};

}  // namespace gantry::GANTRY_ISA
