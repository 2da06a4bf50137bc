// gantryctl._core: what Python sees of the compiled laws and physics. Further parts live in bindings_*.cpp.
#include <nanobind/nanobind.h>

namespace nb = nanobind;

NB_MODULE(_core, m) {
  m.doc() = "Compiled laws and physics of gantryctl.";
  m.def("abi", [] { return 1; }, "A number that changes when the compiled interface does.");
}
