// The position loop: P with velocity feed-forward, the controller half of eq. (4) of the paper. Motor side.
#pragma once

#include "core/lane/lane.hpp"

namespace gantry::GANTRY_ISA {

template <class T>
struct PositionLawParams {
  T kpp_per_s = T(0.0);
  T kvf = T(0.0);
  T ratio = T(1.0);          // motor turns per gantry turn
  T rad_per_count = T(0.0);  // motor angle of one encoder count
  T vel_max_rad_s = T(0.0);  // command clamp, motor side
};

template <class T>
struct PositionLawResult {
  T vel_cmd_rad_s;  // motor side
  T pos_act_rad;    // gantry side, from the motor encoder
  T pos_err_rad;    // gantry side, set-point minus actual
};

// v_cmd = Kpp (i r - y) + Kvf i r'; counts is the encoder count minus its zero offset.
template <class T>
GANTRY_INLINE PositionLawResult<T> position_law(const PositionLawParams<T>& p, T pos_ref_rad, T vel_ref_rad_s,
                                                T counts) {
  const T y = p.rad_per_count * counts;
  const T error = p.ratio * pos_ref_rad - y;
  const T vel = p.kpp_per_s * error + p.kvf * (p.ratio * vel_ref_rad_s);
  return {clamp(vel, -p.vel_max_rad_s, p.vel_max_rad_s), y / p.ratio, error / p.ratio};
}

}  // namespace gantry::GANTRY_ISA
