// What a lane type is: `double`, or a pack of plants (pack.hpp). The physics below uses only these functions
// and
// + - * /, so one source serves the scan (one plant) and a batch (several plants at once), with the same
// bits.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

#include "core/lane/isa.hpp"

// The kernels are one chain of arithmetic: a call in it costs more than what it calls. A build that counts
// branches defines it as `inline`, so that each belongs to the function that it stands in.
#if defined(GANTRY_INLINE)
#elif defined(_MSC_VER)
#define GANTRY_INLINE __forceinline
#else
#define GANTRY_INLINE inline __attribute__((always_inline))
#endif

namespace gantry::GANTRY_ISA {

// What a comparison of two T gives: bool, or one truth per lane.
template <class T>
using MaskOf = decltype(T(0.0) < T(0.0));

GANTRY_INLINE double select(bool mask, double a, double b) { return mask ? a : b; }
GANTRY_INLINE bool any(bool mask) { return mask; }
GANTRY_INLINE bool both(bool a, bool b) { return a && b; }
GANTRY_INLINE bool either(bool a, bool b) { return a || b; }
GANTRY_INLINE bool differ(bool a, bool b) { return a != b; }
GANTRY_INLINE bool negate(bool a) { return !a; }
GANTRY_INLINE double vabs(double x) { return std::fabs(x); }
GANTRY_INLINE double vsqrt(double x) { return std::sqrt(x); }

// +1 for x >= 0, -1 below.
template <class T>
GANTRY_INLINE T sign(T x) {
  return select(x < T(0.0), T(-1.0), T(1.0));
}

// Round half to even by adding and taking away 1.5 * 2^52: exact for |x| < 2^51, no library call, the same in
// a pack.
template <class T>
GANTRY_INLINE T vround(T x) {
  constexpr double kMagic = 6755399441055744.0;
  return (x + T(kMagic)) - T(kMagic);
}

// 2^n for a whole number -1022 <= n <= 1023; something for anything else, NaN too. After adding 1.5 * 2^52
// the lowest bits are those of n as an integer.
GANTRY_INLINE double pow2(double n) {
  const double shifted = n + 6755399441055744.0;
  std::uint64_t bits;
  std::memcpy(&bits, &shifted, sizeof bits);
  bits = (bits + 1023) << 52;
  double result;
  std::memcpy(&result, &bits, sizeof result);
  return result;
}

// The second where the first is NaN.
template <class T>
GANTRY_INLINE T smaller(T x, T y) {
  return select(x < y, x, y);
}
template <class T>
GANTRY_INLINE T larger(T x, T y) {
  return select(x > y, x, y);
}

// Limits x to [lo, hi] and lets NaN through: every comparison with NaN is false, so x itself is returned.
// (max(lo, min(hi, x)) would make full speed out of NaN.)
template <class T>
GANTRY_INLINE T clamp(T x, T lo, T hi) {
  return select(x < lo, lo, select(x > hi, hi, x));
}

// States that decay at standstill reach subnormal numbers, which cost the processor 3.4 times as much.
// Applied once per scan this makes a zero of anything below about 1e-216 and leaves every other number as it
// is.
template <class T>
GANTRY_INLINE T flush_subnormal(T x) {
  constexpr double kTiny = 1e-200;
  return (x + T(kTiny)) - T(kTiny);
}

// The same truth in every lane.
template <class T>
GANTRY_INLINE MaskOf<T> mask(bool value) {
  return T(value ? 1.0 : 0.0) > T(0.0);
}

// One lane of a number that is the same or not in every lane: to read, and to be set. A double has lane 0.
GANTRY_INLINE double lane(double x, int) { return x; }
GANTRY_INLINE bool lane(bool mask, int) { return mask; }
GANTRY_INLINE void set_lane(double& x, int, double value) { x = value; }
GANTRY_INLINE void set_lane(bool& mask, int, bool value) { mask = value; }

template <class T>
constexpr int kLanes = 1;

}  // namespace gantry::GANTRY_ISA
