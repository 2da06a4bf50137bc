// Encoder on the ring, read once a scan: steps, noise, latency, and a scale with errors of its own.
#pragma once

#include <array>
#include <cstdint>

#include "core/lane/elementary.hpp"

namespace gantry::GANTRY_ISA {

template <class T>
struct ScaleTerm {
  T waves = T(0.0);  // per turn
  T amplitude_rad = T(0.0);
  T phase_rad = T(0.0);
};

template <class T>
struct LoadEncoderParams {
  bool fitted = false;
  T step_rad = T(0.0);  // 0: no steps
  T noise_rad = T(0.0);
  T latency_s = T(0.0);
  std::array<ScaleTerm<T>, 4> scale{};
};

// Error of the scale at an angle; zeroed at 0.
template <class T>
T scale_error(const LoadEncoderParams<T>& p, T angle) {
  T sum = T(0.0);
  for (const ScaleTerm<T>& t : p.scale) {
    if (!any(negate(t.amplitude_rad == T(0.0)))) continue;
    const T wave = sincos(t.waves * angle + t.phase_rad).sin - sincos(t.phase_rad).sin;
    sum = sum + t.amplitude_rad * wave;
  }
  return sum;
}

// Noise of reading number n: the sum of four 16-bit numbers from a hash of n, variance 1, mean 0. Near enough
// to a normal one, the same on every machine, and nothing to keep but n.
inline double reading_noise(std::uint64_t n) {
  std::uint64_t x = n * 0x9e3779b97f4a7c15u + 0x632be59bd9b4e019u;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  x ^= x >> 31;
  double sum = 0.0;
  for (int k = 0; k < 4; ++k) sum += static_cast<double>((x >> (16 * k)) & 0xffffu);
  constexpr double kMean = 2.0 * 65535.0;
  constexpr double kScale = 1.0 / 37837.0;  // sqrt(4 (2^32 - 1) / 12)
  return (sum - kMean) * kScale;
}

// The reading of the ring angle `pos` turning with `vel`; number n since the start.
template <class T>
T load_encoder_reading(const LoadEncoderParams<T>& p, T pos, T vel, T n) {
  const T at = pos - vel * p.latency_s;
  T noise{};
  for (int k = 0; k < kLanes<T>; ++k)
    set_lane(noise, k, reading_noise(static_cast<std::uint64_t>(lane(n, k))));
  const T seen = at + scale_error(p, at) + p.noise_rad * noise;
  const auto stepped = p.step_rad > T(0.0);
  return select(stepped, p.step_rad * vround(seen / p.step_rad), seen);
}

}  // namespace gantry::GANTRY_ISA
