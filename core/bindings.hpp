// The parts of the module gantryctl._core, one function each.
#pragma once

#include <nanobind/nanobind.h>

void bind_control(nanobind::module_& m);
void bind_compensation(nanobind::module_& m);
void bind_plant(nanobind::module_& m);
void bind_loop(nanobind::module_& m);
