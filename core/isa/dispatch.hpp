// Which instruction set computes: the best that this processor has, or the one that GANTRYCTL_ISA names.
#pragma once

#include <string>
#include <vector>

#include "core/isa/kernels.hpp"

namespace gantry {

// The instruction sets compiled in that this processor has, worst first.
std::vector<const Kernels*> supported_kernels();

// The one in use, chosen at the first call. Throws std::invalid_argument where GANTRYCTL_ISA names none of
// them.
const Kernels& kernels();

}  // namespace gantry
