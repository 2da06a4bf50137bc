// A pack of N plants: the same arithmetic lane by lane. Simple loops on purpose, the compiler makes vectors
// of them.
#pragma once

#include "core/lane/lane.hpp"

namespace gantry {

template <int N>
struct Mask {
  bool lane[N];
};

template <int N>
struct Pack {
  double lane[N];
  Pack() = default;
  Pack(double x) {  // NOLINT: a number is a pack of equal numbers
    for (double& l : lane) l = x;
  }
};

#define GANTRY_PACK_OP(op)                                          \
  template <int N>                                                  \
  Pack<N> operator op(Pack<N> a, const Pack<N>& b) {                \
    for (int k = 0; k < N; ++k) a.lane[k] = a.lane[k] op b.lane[k]; \
    return a;                                                       \
  }                                                                 \
  template <int N>                                                  \
  Pack<N> operator op(Pack<N> a, double b) {                        \
    return a op Pack<N>(b);                                         \
  }                                                                 \
  template <int N>                                                  \
  Pack<N> operator op(double a, const Pack<N>& b) {                 \
    return Pack<N>(a) op b;                                         \
  }
GANTRY_PACK_OP(+)
GANTRY_PACK_OP(-)
GANTRY_PACK_OP(*)
GANTRY_PACK_OP(/)
#undef GANTRY_PACK_OP

#define GANTRY_PACK_COMPARE(op)                                     \
  template <int N>                                                  \
  Mask<N> operator op(const Pack<N>& a, const Pack<N>& b) {         \
    Mask<N> m;                                                      \
    for (int k = 0; k < N; ++k) m.lane[k] = a.lane[k] op b.lane[k]; \
    return m;                                                       \
  }
GANTRY_PACK_COMPARE(<)
GANTRY_PACK_COMPARE(>)
GANTRY_PACK_COMPARE(<=)
GANTRY_PACK_COMPARE(>=)
GANTRY_PACK_COMPARE(==)
#undef GANTRY_PACK_COMPARE

template <int N>
Pack<N> operator-(const Pack<N>& a) {
  Pack<N> r;
  for (int k = 0; k < N; ++k) r.lane[k] = -a.lane[k];
  return r;
}

template <int N>
Pack<N>& operator+=(Pack<N>& a, const Pack<N>& b) {
  a = a + b;
  return a;
}

template <int N>
Pack<N> select(const Mask<N>& mask, const Pack<N>& a, const Pack<N>& b) {
  Pack<N> r;
  for (int k = 0; k < N; ++k) r.lane[k] = mask.lane[k] ? a.lane[k] : b.lane[k];
  return r;
}

template <int N>
bool any(const Mask<N>& mask) {
  for (bool m : mask.lane)
    if (m) return true;
  return false;
}

template <int N>
Mask<N> both(Mask<N> a, const Mask<N>& b) {
  for (int k = 0; k < N; ++k) a.lane[k] = a.lane[k] && b.lane[k];
  return a;
}

template <int N>
Mask<N> either(Mask<N> a, const Mask<N>& b) {
  for (int k = 0; k < N; ++k) a.lane[k] = a.lane[k] || b.lane[k];
  return a;
}

template <int N>
Mask<N> negate(Mask<N> a) {
  for (bool& m : a.lane) m = !m;
  return a;
}

#define GANTRY_PACK_FUNCTION(name)        \
  template <int N>                        \
  Pack<N> name(Pack<N> a) {               \
    for (double& l : a.lane) l = name(l); \
    return a;                             \
  }
GANTRY_PACK_FUNCTION(vabs)
GANTRY_PACK_FUNCTION(vsqrt)
GANTRY_PACK_FUNCTION(pow2)
#undef GANTRY_PACK_FUNCTION

}  // namespace gantry
