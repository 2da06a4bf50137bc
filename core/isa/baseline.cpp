#define GANTRY_ISA baseline
#define GANTRY_ISA_LANES 2
#include "core/isa/table.hpp"

extern "C" const void* gantry_kernels_baseline() { return &gantry::GANTRY_ISA::kTable; }
