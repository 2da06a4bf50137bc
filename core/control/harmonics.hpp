// A periodic function of the gantry angle as a sum of waves: how maps that were measured are stored.
#pragma once

#include <array>

#include "core/lane/elementary.hpp"
#include "core/lane/lane.hpp"

namespace gantry::GANTRY_ISA {

template <class T>
struct Curve {
  T value;
  T slope;  // per radian of the angle
};

// a0 + sum of sine[n-1] sin(n x) + cosine[n-1] cos(n x), n = 1..N; above n = used they are 0.
template <class T, int N>
struct Harmonics {
  int used = N;
  T mean = T(0.0);
  std::array<T, N> sine{};
  std::array<T, N> cosine{};
};

// By recurrence: one sine and cosine for all.
template <class T, int N>
Curve<T> harmonics(const Harmonics<T, N>& h, T x) {
  const SinCos<T> first = sincos(x);
  SinCos<T> s = first;
  Curve<T> sum{h.mean, T(0.0)};
  for (int k = 0; k < h.used; ++k) {
    const T n = T(static_cast<double>(k + 1));
    sum.value = sum.value + (h.sine[k] * s.sin + h.cosine[k] * s.cos);
    sum.slope = sum.slope + n * (h.sine[k] * s.cos - h.cosine[k] * s.sin);
    s = angle_sum(s, first);
  }
  return sum;
}

// One wave of many cycles per turn, whole or not: tooth mesh, reducer.
template <class T>
struct FastWave {
  T cycles = T(0.0);
  T sine = T(0.0);
  T cosine = T(0.0);
};

template <class T>
Curve<T> fast_wave(const FastWave<T>& w, T x) {
  const SinCos<T> s = sincos(w.cycles * x);
  return {w.sine * s.sin + w.cosine * s.cos, w.cycles * (w.sine * s.cos - w.cosine * s.sin)};
}

}  // namespace gantry::GANTRY_ISA
