// gantryctl._core: what Python sees of the compiled laws and physics.
#include "core/bindings.hpp"

NB_MODULE(_core, m) {
  // What a cache still holds when the interpreter ends is no leak; leaks are looked for with the sanitizer.
  nanobind::set_leak_warnings(false);
  m.doc() =
      "Compiled laws and physics of gantryctl: set-point sampling, position law, drive, plant, closed loop.";
  bind_control(m);
  bind_compensation(m);
  bind_plant(m);
  bind_loop(m);
}
