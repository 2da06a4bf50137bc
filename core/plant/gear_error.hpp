// Gear-error map (plant equations S2): what the gears add to an ideal transmission, and its slope.
#pragma once

#include <cstddef>

#include "core/lane/elementary.hpp"
#include "core/plant/params.hpp"

namespace gantry::GANTRY_ISA {

// A sin(n x + phase) = a sin(n x) + b cos(n x).
template <class T>
struct Harmonic {
  T a = T(0.0);
  T b = T(0.0);
  Harmonic() = default;
  Harmonic(T amplitude, T phase) {
    const SinCos<T> p = sincos(phase);
    a = amplitude * p.cos;
    b = amplitude * p.sin;
  }
  GANTRY_INLINE T value(SinCos<T> x) const { return a * x.sin + b * x.cos; }
  GANTRY_INLINE T slope(SinCos<T> x) const { return a * x.cos - b * x.sin; }  // per n x
};

template <class T>
struct ErrorValue {
  T error = T(0.0);  // rad at the gantry
  T slope = T(0.0);  // rad per rad of the argument
};

template <class T>
struct GearError {
  std::array<Harmonic<T>, kRingHarmonics> ring;
  Harmonic<T> reducer_1x, reducer_2x, reducer_4x, pinion, mesh;
  T pinion_per_motor = T(1.0);  // 1/i1
  T teeth = T(1.0);             // tooth-mesh cycles per pinion turn

  GearError() = default;
  explicit GearError(const PlantParams<T>& p)
      : reducer_1x(p.error_reducer_1x_rad, p.phase_reducer_1x_rad),
        reducer_2x(p.error_reducer_2x_rad, p.phase_reducer_2x_rad),
        reducer_4x(p.error_reducer_4x_rad, p.phase_reducer_4x_rad),
        pinion(p.error_pinion_rad, p.phase_pinion_rad),
        mesh(p.error_mesh_rad, p.phase_mesh_rad),
        pinion_per_motor(T(1.0) / p.reducer_ratio),
        teeth(T(p.pinion_teeth)) {
    for (std::size_t n = 0; n < kRingHarmonics; ++n)
      ring[n] = Harmonic<T>(p.error_ring_rad[n], p.phase_ring_rad[n]);
  }

  // e_r(rho) = sum_n A_n sin(n rho + phase_n). The multiples of rho come from sums of angles, four at a time
  // and in four separate sums: a chain of twelve would wait for every product.
  GANTRY_INLINE ErrorValue<T> ring_error(T rho) const {
    static_assert(kRingHarmonics % 4 == 0, "harmonics are taken in fours");
    SinCos<T> x[4];
    x[0] = sincos(rho);
    x[1] = angle_sum(x[0], x[0]);
    x[2] = angle_sum(x[1], x[0]);
    x[3] = angle_sum(x[1], x[1]);
    const SinCos<T> step = x[3];
    T error[4] = {T(0.0), T(0.0), T(0.0), T(0.0)};
    T slope[4] = {T(0.0), T(0.0), T(0.0), T(0.0)};
    for (int first = 0; first < kRingHarmonics; first += 4)
      for (int k = 0; k < 4; ++k) {
        const Harmonic<T>& h = ring[static_cast<std::size_t>(first + k)];
        error[k] = error[k] + h.value(x[k]);
        slope[k] = slope[k] + T(first + k + 1.0) * h.slope(x[k]);
        x[k] = angle_sum(x[k], step);
      }
    return {(error[0] + error[1]) + (error[2] + error[3]), (slope[0] + slope[1]) + (slope[2] + slope[3])};
  }

  // e_m(theta_m); motor = sine and cosine of theta_m.
  GANTRY_INLINE ErrorValue<T> motor_error(T pos_motor, const SinCos<T>& motor) const {
    const SinCos<T> twice = angle_sum(motor, motor);
    const SinCos<T> four = angle_sum(twice, twice);
    const T pinion_angle = pos_motor * pinion_per_motor;
    const SinCos<T> turn = sincos(pinion_angle);
    const SinCos<T> tooth = sincos(pinion_angle * teeth);
    ErrorValue<T> e;
    e.error = (reducer_1x.value(motor) + reducer_2x.value(twice)) + reducer_4x.value(four) +
              (pinion.value(turn) + mesh.value(tooth));
    e.slope = (reducer_1x.slope(motor) + T(2.0) * reducer_2x.slope(twice)) + T(4.0) * reducer_4x.slope(four) +
              (pinion.slope(turn) + teeth * mesh.slope(tooth)) * pinion_per_motor;
    return e;
  }
};

}  // namespace gantry::GANTRY_ISA
