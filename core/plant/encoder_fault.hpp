// A faulty motor encoder, as the reading and the drive's own speed loop both see it.
#pragma once

#include "core/lane/lane.hpp"

namespace gantry::GANTRY_ISA {

// Shows `gain` x the motion of the shaft since the fault, beginning where the encoder showed the shaft then.
// A fault of the reading alone, behind a sound speed loop, is made at the drive's port instead.
template <class T>
struct EncoderFault {
  bool spoilt = false;
  T gain = T(1.0);
  T pos_start = T(0.0);   // shaft when the gain was set, rad
  T seen_start = T(0.0);  // what the encoder showed then, rad

  T position(T pos) const { return spoilt ? seen_start + gain * (pos - pos_start) : pos; }
  T speed(T vel) const { return spoilt ? gain * vel : vel; }

  void set_gain(T wanted, T pos) {
    seen_start = position(pos);
    pos_start = pos;
    gain = wanted;
    spoilt = true;
  }

  void jump(T angle, T pos) {
    set_gain(gain, pos);
    seen_start = seen_start + angle;
  }
};

}  // namespace gantry::GANTRY_ISA
