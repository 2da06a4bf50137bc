// gantryctl._core: what Python sees of the compiled laws and physics.
#include "core/bindings.hpp"

NB_MODULE(_core, m) {
  m.doc() =
      "Compiled laws and physics of gantryctl: set-point sampling, position law, drive, plant, closed loop.";
  bind_control(m);
  bind_compensation(m);
  bind_plant(m);
  bind_loop(m);
}
