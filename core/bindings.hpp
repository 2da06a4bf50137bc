// The parts of the module gantryctl._core, one function each.
#pragma once

#include <nanobind/nanobind.h>

#include "core/plant/drive.hpp"

// 0 off, 1 speed, 2 quick stop; throws std::invalid_argument for anything else.
gantry::DriveMode drive_mode(int mode);

void bind_control(nanobind::module_& m);
void bind_compensation(nanobind::module_& m);
void bind_plant(nanobind::module_& m);
void bind_loop(nanobind::module_& m);
void bind_image(nanobind::module_& m);
