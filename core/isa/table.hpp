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

// One plant alone is run as a number: a pack of copies would take longer.
inline void run_group(const JobGroup& group) {
  const Job* first = group.draw();
  if (first == nullptr) return;
  if (group.count == 1)
    Batch<double>().run(group, first);
  else
    Batch<Twin<Pack<GANTRY_ISA_LANES>>>().run(group, first);
}

constexpr Kernels kTable = {
    GANTRY_TEXT(GANTRY_ISA), GANTRY_ISA_LANES, scan, run_plan, run_command, run_group};

}  // namespace gantry::GANTRY_ISA
