// Gear-error map (plant_equations S2): what the gears add to an ideal transmission, and its slope.
#pragma once

#include "core/lane/elementary.hpp"
#include "core/plant/params.hpp"

namespace gantry {

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
  T value(SinCos<T> x) const { return a * x.sin + b * x.cos; }
  T slope(SinCos<T> x) const { return a * x.cos - b * x.sin; }  // per n x
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

  GearError() = default;
  explicit GearError(const PlantParams<T>& p)
      : reducer_1x(p.error_reducer_1x, p.phase_reducer_1x),
        reducer_2x(p.error_reducer_2x, p.phase_reducer_2x),
        reducer_4x(p.error_reducer_4x, p.phase_reducer_4x),
        pinion(p.error_pinion, p.phase_pinion),
        mesh(p.error_mesh, p.phase_mesh) {
    for (int n = 0; n < kRingHarmonics; ++n) ring[n] = Harmonic<T>(p.error_ring[n], p.phase_ring[n]);
  }

  // e_r(rho) = sum_n A_n sin(n rho + phase_n), by the recurrence of sin(n x) and cos(n x).
  ErrorValue<T> ring_error(T rho) const {
    const SinCos<T> first = sincos(rho);
    SinCos<T> x = first;
    ErrorValue<T> e;
    for (int n = 0; n < kRingHarmonics; ++n) {
      e.error = e.error + ring[n].value(x);
      e.slope = e.slope + T(n + 1.0) * ring[n].slope(x);
      x = {x.sin * first.cos + x.cos * first.sin, x.cos * first.cos - x.sin * first.sin};
    }
    return e;
  }

  // e_m(theta_m); motor = sine and cosine of theta_m, which the torque ripple needs too.
  ErrorValue<T> motor_error(const PlantParams<T>& p, T pos_motor, SinCos<T> motor) const {
    const SinCos<T> twice = multiple_angle(motor, 2);
    const SinCos<T> four = multiple_angle(twice, 2);
    const SinCos<T> turn = sincos(pos_motor / p.reducer_ratio);
    const SinCos<T> tooth = multiple_angle(turn, p.pinion_teeth);
    ErrorValue<T> e;
    e.error = (reducer_1x.value(motor) + reducer_2x.value(twice)) + reducer_4x.value(four) +
              (pinion.value(turn) + mesh.value(tooth));
    e.slope = (reducer_1x.slope(motor) + T(2.0) * reducer_2x.slope(twice)) + T(4.0) * reducer_4x.slope(four) +
              (pinion.slope(turn) + T(p.pinion_teeth) * mesh.slope(tooth)) / p.reducer_ratio;
    return e;
  }
};

}  // namespace gantry
