#define GANTRY_ISA avx2
#define GANTRY_ISA_LANES 4
#include "core/isa/table.hpp"

extern "C" const void* gantry_kernels_avx2() { return &gantry::GANTRY_ISA::kTable; }
