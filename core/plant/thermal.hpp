// What temperatures change (plant equations S13): backlash, viscous friction, torque per current.
#pragma once

#include "core/lane/elementary.hpp"
#include "core/plant/params.hpp"

namespace gantry::GANTRY_ISA {

template <class T>
struct Thermal {
  T half_backlash;
  T viscosity = T(1.0);  // of that at alignment
  T motor_torque;        // of that which the drive believes

  // A time after the start.
  Thermal(const PlantParams<T>& p, T time)
      : half_backlash(p.half_backlash_rad), motor_torque(p.torque_constant_ratio) {
    if (!p.thermal) return;
    const T gear =
        p.gear_temp_end_k + (p.gear_temp_start_k - p.gear_temp_end_k) * vexp(-(time / p.gear_temp_time_s));
    const T motor = p.motor_temp_end_k +
                    (p.motor_temp_start_k - p.motor_temp_end_k) * vexp(-(time / p.motor_temp_time_s));
    if (p.backlash) half_backlash = larger(half_backlash + p.half_backlash_rad_per_k * gear, T(0.0));
    viscosity = vexp(p.viscosity_per_k * gear);
    motor_torque = motor_torque * (T(1.0) + p.torque_constant_per_k * motor);
  }
};

}  // namespace gantry::GANTRY_ISA
