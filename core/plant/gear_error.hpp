// Gear-error map (plant equations S2): what the gears add to an ideal transmission, and its slope.
#pragma once

#include <cstddef>

#include "core/lane/elementary.hpp"
#include "core/plant/params.hpp"

namespace gantry::GANTRY_ISA {

template <class T>
struct ErrorValue {
  T error = T(0.0);  // rad at the gantry
  T slope = T(0.0);  // rad per rad of the argument

  // One wave, at an angle further on by that of `by`.
  GANTRY_INLINE ErrorValue rotated(const SinCos<T>& by) const {
    return {error * by.cos + slope * by.sin, slope * by.cos - error * by.sin};
  }
};

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
  ErrorValue<T> at(T x) const {
    const SinCos<T> s = sincos(x);
    return {value(s), slope(s)};
  }
};

// Gear error at an angle, of the ring or of single teeth, continued from there to the second order. Linear
// continuation over 1 ms would move a load at full speed by 1e-7 deg, the second order by 1e-10
// (anchor_test.cpp).
template <class T>
struct RingError {
  T rho = T(0.0);
  T error = T(0.0);
  T slope = T(0.0);
  T curvature = T(0.0);

  GANTRY_INLINE ErrorValue<T> at(T other) const {
    const T way = other - rho;
    const T bend = curvature * way;
    return {error + way * (slope + T(0.5) * bend), slope + bend};
  }
};

template <class T>
struct GearError {
  std::array<Harmonic<T>, kRingHarmonics> ring;
  Harmonic<T> reducer_1x, reducer_2x, reducer_4x, pinion, mesh;
  T pinion_per_motor;  // 1/i1
  T teeth;             // tooth-mesh cycles per pinion turn
  T reach;             // way of the motor, rad, over which waves are continued (anchor.hpp)

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
    // 0.2 rad of the teeth, or 0.03 rad of the pinion
    const T tooth_reach = T(0.2) / (teeth * pinion_per_motor);
    const T turn_reach = T(0.03) / pinion_per_motor;
    reach = smaller(smaller(tooth_reach, turn_reach), T(0.5));
  }

  // That of the second pinion: the same gears in the same ring, begun at other angles.
  static GearError of_second(PlantParams<T> p) {
    p.phase_reducer_2x_rad = p.second_phase_reducer_2x_rad;
    p.phase_reducer_1x_rad = p.second_phase_reducer_1x_rad;
    p.phase_reducer_4x_rad = p.second_phase_reducer_4x_rad;
    p.phase_pinion_rad = p.second_phase_pinion_rad;
    p.phase_mesh_rad = p.second_phase_mesh_rad;
    return GearError(p);
  }

  // e_r(rho) = sum_n A_n sin(n rho + phase_n). The multiples of rho come from sums of angles, four at a time
  // and in four separate sums: a chain of twelve would wait for every product.
  RingError<T> ring_error(T rho) const {
    static_assert(kRingHarmonics % 4 == 0, "harmonics are taken in fours");
    SinCos<T> x[4];
    x[0] = sincos(rho);
    x[1] = angle_sum(x[0], x[0]);
    x[2] = angle_sum(x[1], x[0]);
    x[3] = angle_sum(x[1], x[1]);
    const SinCos<T> step = x[3];
    T error[4] = {T(0.0), T(0.0), T(0.0), T(0.0)};
    T slope[4] = {T(0.0), T(0.0), T(0.0), T(0.0)};
    T bend[4] = {T(0.0), T(0.0), T(0.0), T(0.0)};
    for (int first = 0; first < kRingHarmonics; first += 4)
      for (int k = 0; k < 4; ++k) {
        const Harmonic<T>& h = ring[static_cast<std::size_t>(first + k)];
        const double n = first + k + 1.0;
        const T value = h.value(x[k]);
        error[k] = error[k] + value;
        slope[k] = slope[k] + T(n) * h.slope(x[k]);
        bend[k] = bend[k] + T(n * n) * value;
        x[k] = angle_sum(x[k], step);
      }
    return {rho, (error[0] + error[1]) + (error[2] + error[3]), (slope[0] + slope[1]) + (slope[2] + slope[3]),
            -((bend[0] + bend[1]) + (bend[2] + bend[3]))};
  }

  // e_m(theta_m) from sine and cosine of theta_m and the waves of pinion and teeth at it.
  GANTRY_INLINE ErrorValue<T> motor_error(const SinCos<T>& motor, const SinCos<T>& two, const SinCos<T>& four,
                                          const ErrorValue<T>& turn, const ErrorValue<T>& tooth) const {
    return {(reducer_1x.value(motor) + reducer_2x.value(two)) + reducer_4x.value(four) +
                (turn.error + tooth.error),
            (reducer_1x.slope(motor) + T(2.0) * reducer_2x.slope(two)) + T(4.0) * reducer_4x.slope(four) +
                (turn.slope + teeth * tooth.slope) * pinion_per_motor};
  }

  // The same at any angle.
  ErrorValue<T> motor_error(T pos_motor) const {
    const SinCos<T> motor = sincos(pos_motor);
    const SinCos<T> two = twice(motor);
    const T pinion_angle = pos_motor * pinion_per_motor;
    return motor_error(motor, two, twice(two), pinion.at(pinion_angle), mesh.at(pinion_angle * teeth));
  }
};

}  // namespace gantry::GANTRY_ISA
