// Sine, cosine and exponential with + - * / only: the same bits on every compiler, processor and vector
// width. Taylor series on a reduced argument; error below 1e-15 (tests compare with the C library).
#pragma once

#include "core/lane/lane.hpp"

namespace gantry::GANTRY_ISA {

template <class T>
struct SinCos {
  T sin;
  T cos;
};

// |x| < 1e6 rad. Reduction by pi/2 in three parts of 33 bits (n * part is exact), then sin and cos on [-pi/4,
// pi/4].
template <class T>
GANTRY_INLINE SinCos<T> sincos(T x) {
  constexpr double kTwoOverPi = 0.6366197723675814;
  constexpr double kPart1 = 0x1.921fb544p+0;
  constexpr double kPart2 = 0x1.0b4611a6p-34;
  constexpr double kPart3 = 2.0222662487959506e-21;
  const T n = vround(x * T(kTwoOverPi));
  const T r = ((x - n * T(kPart1)) - n * T(kPart2)) - n * T(kPart3);
  const T z = r * r;
  const T z2 = z * z;
  const T z4 = z2 * z2;
  const T ps = ((T(-1.0 / 6.0) + T(1.0 / 120.0) * z) + (T(-1.0 / 5040.0) + T(1.0 / 362880.0) * z) * z2) +
               ((T(-1.0 / 39916800.0) + T(1.0 / 6227020800.0) * z) +
                (T(-1.0 / 1307674368000.0) + T(1.0 / 355687428096000.0) * z) * z2) *
                   z4;
  const T pc = ((T(-1.0 / 2.0) + T(1.0 / 24.0) * z) + (T(-1.0 / 720.0) + T(1.0 / 40320.0) * z) * z2) +
               ((T(-1.0 / 3628800.0) + T(1.0 / 479001600.0) * z) +
                (T(-1.0 / 87178291200.0) + T(1.0 / 20922789888000.0) * z) * z2) *
                   z4;
  const T s = r + r * z * ps;
  const T c = T(1.0) + z * pc;
  // n = 4 m + 2 h + o: o swaps sine and cosine, h changes both signs.
  const T half = vround(n * T(0.5) - T(0.25));
  const T o = n - half - half;
  const T quarter = vround(half * T(0.5) - T(0.25));
  const T flip = T(1.0) - T(2.0) * (half - quarter - quarter);
  const auto odd = o > T(0.5);
  return {flip * select(odd, c, s), flip * select(odd, -s, c)};
}

// Sine in the neighbourhood of a point: rotated from there, a third of the latency of sincos. Error below
// 1e-14 while |x - at| < 0.07 rad.
template <class T>
class SineNear {
 public:
  explicit SineNear(T at) : at_(at), value_(sincos(at)) {}

  GANTRY_INLINE T operator()(T x) const {
    const T d = x - at_;
    const T z = d * d;
    const T z2 = z * z;
    const T s = (T(1.0) + T(-1.0 / 6.0) * z) + (T(1.0 / 120.0) + T(-1.0 / 5040.0) * z) * z2;
    const T c = (T(1.0) + T(-1.0 / 2.0) * z) + (T(1.0 / 24.0) + T(-1.0 / 720.0) * z) * z2;
    return value_.sin * c + value_.cos * (d * s);
  }

 private:
  T at_;
  SinCos<T> value_;
};

// exp(x) for x <= 709; below -708 the result stays at exp(-708), so nothing becomes subnormal.
template <class T>
GANTRY_INLINE T vexp(T x) {
  constexpr double kLog2e = 1.4426950408889634;
  constexpr double kLn2High = 0x1.62e42fef00000p-1;
  constexpr double kLn2Low = 7.440617110012397e-11;
  const T y = select(x < T(-708.0), T(-708.0), x);
  const T n = vround(y * T(kLog2e));
  const T r = (y - n * T(kLn2High)) - n * T(kLn2Low);
  const T r2 = r * r;
  const T r4 = r2 * r2;
  const T r8 = r4 * r4;
  const T p =
      ((T(1.0) + r) + (T(1.0 / 2.0) + T(1.0 / 6.0) * r) * r2) +
      ((T(1.0 / 24.0) + T(1.0 / 120.0) * r) + (T(1.0 / 720.0) + T(1.0 / 5040.0) * r) * r2) * r4 +
      ((T(1.0 / 40320.0) + T(1.0 / 362880.0) * r) + (T(1.0 / 3628800.0) + T(1.0 / 39916800.0) * r) * r2 +
       (T(1.0 / 479001600.0) + T(1.0 / 6227020800.0) * r) * r4) *
          r8;
  return p * pow2(n);
}

// Sine and cosine of a + b from those of a and b.
template <class T>
GANTRY_INLINE SinCos<T> angle_sum(const SinCos<T>& a, const SinCos<T>& b) {
  return {a.sin * b.cos + a.cos * b.sin, a.cos * b.cos - a.sin * b.sin};
}

}  // namespace gantry::GANTRY_ISA
