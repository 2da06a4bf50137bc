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

// sin(pi t) for |t| <= 1/2 needs no reduction; error below 1e-15.
template <class T>
GANTRY_INLINE T sin_pi(T t) {
  const T z = t * t;
  const T z2 = z * z;
  const T z4 = z2 * z2;
  const T low = (T(0x1.921fb54442d17p+1) - T(0x1.4abbce625bd83p+2) * z) +
                (T(0x1.466bc677522bdp+1) - T(0x1.32d2cce1ea145p-1) * z) * z2;
  const T high = (T(0x1.5078327046959p-4) - T(0x1.e30631bdf732dp-8) * z) +
                 (T(0x1.e89f6fe44fe7bp-12) - T(0x1.62903d02bb153p-16) * z) * z2;
  return t * (low + high * z4);
}

// Sine and cosine of a small angle by the first terms of their series: kTerms of the sine, as many after the
// 1 of the cosine but for 2, where the second would be less than what the sine leaves out.
template <int kTerms, class T>
GANTRY_INLINE SinCos<T> sincos_small(T d) {
  const T z = d * d;
  if constexpr (kTerms == 2) {
    return {d * (T(1.0) - T(1.0 / 6.0) * z), T(1.0) - T(0.5) * z};
  } else if constexpr (kTerms == 3) {
    const T z2 = z * z;
    return {d * ((T(1.0) - T(1.0 / 6.0) * z) + T(1.0 / 120.0) * z2),
            (T(1.0) - T(0.5) * z) + T(1.0 / 24.0) * z2};
  } else {
    static_assert(kTerms == 4);
    const T z2 = z * z;
    return {d * ((T(1.0) - T(1.0 / 6.0) * z) + (T(1.0 / 120.0) - T(1.0 / 5040.0) * z) * z2),
            (T(1.0) - T(0.5) * z) + (T(1.0 / 24.0) - T(1.0 / 720.0) * z) * z2};
  }
}

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

// Of 2 a from those of a.
template <class T>
GANTRY_INLINE SinCos<T> twice(const SinCos<T>& a) {
  const T s = a.sin + a.sin;
  return {s * a.cos, T(1.0) - s * a.sin};
}

// Of n a from those of a, n >= 1, by doubling.
template <class T>
GANTRY_INLINE SinCos<T> multiple(SinCos<T> a, int n) {
  for (; n % 2 == 0; n /= 2) a = twice(a);
  SinCos<T> sum = a;
  for (n /= 2; n > 0; n /= 2) {
    a = twice(a);
    if (n % 2 == 1) sum = angle_sum(sum, a);
  }
  return sum;
}

}  // namespace gantry::GANTRY_ISA
