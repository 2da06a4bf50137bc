// Encoder on the ring, read once a scan: steps, noise, latency, and a scale with errors of its own.
#pragma once

#include <array>
#include <cstdint>

#include "core/lane/elementary.hpp"

namespace gantry {

struct ScaleTerm {
  double waves = 0.0;  // per turn
  double amplitude_rad = 0.0;
  double phase_rad = 0.0;
};

struct LoadEncoderParams {
  bool fitted = false;
  double step_rad = 0.0;  // 0: no steps
  double noise_rad = 0.0;
  double latency_s = 0.0;
  std::array<ScaleTerm, 4> scale{};
};

// Error of the scale at an angle; zeroed at 0.
inline double scale_error(const LoadEncoderParams& p, double angle) {
  double sum = 0.0;
  for (const ScaleTerm& t : p.scale)
    if (t.amplitude_rad != 0.0)
      sum += t.amplitude_rad * (sincos(t.waves * angle + t.phase_rad).sin - sincos(t.phase_rad).sin);
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
inline double load_encoder_reading(const LoadEncoderParams& p, double pos, double vel, std::uint64_t n) {
  const double at = pos - vel * p.latency_s;
  const double seen = at + scale_error(p, at) + p.noise_rad * reading_noise(n);
  return p.step_rad > 0.0 ? p.step_rad * vround(seen / p.step_rad) : seen;
}

}  // namespace gantry
