#define GANTRY_ISA avx512
#define GANTRY_ISA_LANES 8
#include "core/isa/table.hpp"

extern "C" const void* gantry_kernels_avx512() { return &gantry::GANTRY_ISA::kTable; }
