// Pitch errors of single teeth (plant equations S13): what the teeth in mesh add to the gear error.
#pragma once

#include "core/plant/gear_error.hpp"

namespace gantry::GANTRY_ISA {

// While one pair carries, the error is that of its tooth; while two do, it passes from one to the next with
// their stiffness (Mark 1978), here a polynomial of the fifth degree, so that slope and curvature are
// continuous. `units`: angle in pitches; units_per_rad: of the argument in which slope and curvature are
// given.
template <class T, class Deviation>
RingError<T> pitch_error(T pos, T units, T units_per_rad, T contact_ratio, const Deviation& deviation) {
  const T tooth = vround(units - T(0.5));  // the last one passed
  T here{}, next{};
  for (int k = 0; k < kLanes<T>; ++k) {
    const double number = lane(tooth, k);
    const long n = vabs(number) < 1e9 ? static_cast<long>(number) : 0;  // NaN is none
    set_lane(here, k, deviation(k, n));
    set_lane(next, k, deviation(k, n + 1));
  }
  const T per_pitch = T(1.0) / (contact_ratio - T(1.0));
  const T passing = ((units - tooth) - (T(2.0) - contact_ratio)) * per_pitch;
  const T w = clamp(passing, T(0.0), T(1.0));
  const T rate = per_pitch * units_per_rad;
  const T left = T(1.0) - w;
  const T step = next - here;
  return {pos, here + step * (w * w * w * (T(10.0) + w * (T(6.0) * w - T(15.0)))),
          step * rate * (T(30.0) * w * w * left * left),
          step * rate * rate * (T(60.0) * w * left * (left - w))};
}

constexpr double kTurnsPerRad = 0.15915494309189535;

// Of the ring, over its own angle at the pinion.
template <class T>
RingError<T> ring_pitch_error(const PlantParams<T>& p, T rho) {
  const T per_rad = T(p.ring_teeth * kTurnsPerRad);
  return pitch_error(rho, rho * per_rad, per_rad, p.contact_ratio, [&p](int k, long n) {
    const long turn = p.ring_teeth;
    return tooth_pitch_of(p.pitch, k).ring_rad[static_cast<std::size_t>(((n % turn) + turn) % turn)];
  });
}

// Of a pinion, over the angle of its motor.
template <class T>
RingError<T> pinion_pitch_error(const PlantParams<T>& p, T pos_motor, Pinion pinion = Pinion::kFirst) {
  const T per_rad = T(p.pinion_teeth * kTurnsPerRad) / p.reducer_ratio;
  return pitch_error(pos_motor, pos_motor * per_rad, per_rad, p.contact_ratio, [&p, pinion](int k, long n) {
    const long turn = p.pinion_teeth;
    return tooth_pitch_of(p.pitch, k).of(pinion)[static_cast<std::size_t>(((n % turn) + turn) % turn)];
  });
}

}  // namespace gantry::GANTRY_ISA
