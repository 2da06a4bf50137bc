// The namespace of everything numeric: one per instruction set that the core is compiled for. A function of
// one can then never be linked in place of another's, which an older processor would not survive.
#pragma once

#ifndef GANTRY_ISA
#define GANTRY_ISA baseline
#endif

namespace gantry {
inline namespace GANTRY_ISA {}
}  // namespace gantry
