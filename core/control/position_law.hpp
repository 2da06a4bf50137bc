// The position loop: P with velocity feed-forward, the controller half of eq. (4) of the paper. Motor side.
#pragma once

#include "core/lane/lane.hpp"

namespace gantry {

struct PositionLawParams {
  double kpp_per_s = 0.0;
  double kvf = 0.0;
  double ratio = 1.0;          // motor turns per gantry turn
  double rad_per_count = 0.0;  // motor angle of one encoder count
  double vel_max_rad_s = 0.0;  // command clamp, motor side
};

template <class T>
struct PositionLawResult {
  T vel_cmd_rad_s;  // motor side
  T pos_act_rad;    // gantry side, from the motor encoder
  T pos_err_rad;    // gantry side, set-point minus actual
};

// v_cmd = Kpp (i r - y) + Kvf i r'; counts is the encoder count minus its zero offset.
template <class T>
PositionLawResult<T> position_law(const PositionLawParams& p, T pos_ref_rad, T vel_ref_rad_s, T counts) {
  const T y = T(p.rad_per_count) * counts;
  const T error = T(p.ratio) * pos_ref_rad - y;
  const T vel = T(p.kpp_per_s) * error + T(p.kvf) * (T(p.ratio) * vel_ref_rad_s);
  return {clamp(vel, T(-p.vel_max_rad_s), T(p.vel_max_rad_s)), y / T(p.ratio), error / T(p.ratio)};
}

}  // namespace gantry
