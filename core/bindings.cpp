// gantryctl._core: what Python sees of the compiled laws and physics.
#include "core/bindings.hpp"

#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include "core/isa/dispatch.hpp"

NB_MODULE(_core, m) {
  // What a cache still holds when the interpreter ends is no leak; leaks are looked for with the sanitizer.
  nanobind::set_leak_warnings(false);
  m.doc() =
      "Compiled laws and physics of gantryctl: set-point sampling, position law, drive, plant, closed loop.";
  gantry::kernels();  // a wrong GANTRYCTL_ISA is refused here
  m.def(
      "isa", [] { return std::string(gantry::kernels().name); },
      "Instruction set in use: the best that this processor has, or that named by GANTRYCTL_ISA.");
  m.def(
      "isas",
      [] {
        std::vector<std::string> names;
        for (const gantry::Kernels* k : gantry::supported_kernels()) names.emplace_back(k->name);
        return names;
      },
      "Instruction sets that this processor has and the core was compiled for, worst first.");
  bind_control(m);
  bind_compensation(m);
  bind_plant(m);
  bind_loop(m);
  bind_image(m);
}
