// What is compiled once per instruction set: everything that takes time. Included by one source per set,
// which defines GANTRY_ISA first; the widest pack is that of its registers.
#pragma once

#include "core/loop/batch.hpp"

namespace gantry::GANTRY_ISA {

// The entry points of one instruction set. The layout is the same in all of them.
struct Kernels {
  const char* name;
  int lanes;  // numbers in a register
  void (*scan)(GantrySim<double>& sim, const DriveCommand<double>& command, bool brake_open);
  void (*run_plan)(GantrySim<double>& sim, const Control<double>& control, const Segments& plan,
                   const LogTable& table);
  void (*run_command)(GantrySim<double>& sim, const DriveCommand<double>& command, bool brake_open,
                      const LogTable& table);
  void (*run_group)(const JobGroup& group);
  long (*arithmetic)(long rounds);
};

}  // namespace gantry::GANTRY_ISA
