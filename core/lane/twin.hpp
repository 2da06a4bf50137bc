// Two packs side by side. One pack alone waits for its own results most of the time: a drive cycle is a long
// chain of operations. A second one, independent of the first, fills the gaps.
#pragma once

#include "core/lane/lane.hpp"

namespace gantry::GANTRY_ISA {

template <class P>
struct TwinMask {
  MaskOf<P> a, b;
};

template <class P>
struct Twin {
  P a, b;
  Twin() = default;
  GANTRY_INLINE Twin(P a_, P b_) : a(a_), b(b_) {}
  GANTRY_INLINE Twin(double x) : a(x), b(x) {}  // NOLINT: a number is a pack of equal numbers
};

#define GANTRY_TWIN_OP(op, result)                                          \
  template <class P>                                                        \
  GANTRY_INLINE result<P> operator op(const Twin<P>& x, const Twin<P>& y) { \
    return {x.a op y.a, x.b op y.b};                                        \
  }
GANTRY_TWIN_OP(+, Twin)
GANTRY_TWIN_OP(-, Twin)
GANTRY_TWIN_OP(*, Twin)
GANTRY_TWIN_OP(/, Twin)
GANTRY_TWIN_OP(<, TwinMask)
GANTRY_TWIN_OP(>, TwinMask)
GANTRY_TWIN_OP(<=, TwinMask)
GANTRY_TWIN_OP(>=, TwinMask)
GANTRY_TWIN_OP(==, TwinMask)
#undef GANTRY_TWIN_OP

#define GANTRY_TWIN_MASK(name)                                                 \
  template <class P>                                                           \
  GANTRY_INLINE TwinMask<P> name(const TwinMask<P>& x, const TwinMask<P>& y) { \
    return {name(x.a, y.a), name(x.b, y.b)};                                   \
  }
GANTRY_TWIN_MASK(both)
GANTRY_TWIN_MASK(either)
GANTRY_TWIN_MASK(differ)
#undef GANTRY_TWIN_MASK

template <class P>
GANTRY_INLINE TwinMask<P> negate(const TwinMask<P>& x) {
  return {negate(x.a), negate(x.b)};
}
template <class P>
GANTRY_INLINE bool any(const TwinMask<P>& x) {
  return any(either(x.a, x.b));
}
template <class P>
GANTRY_INLINE Twin<P> select(const TwinMask<P>& mask, const Twin<P>& x, const Twin<P>& y) {
  return {select(mask.a, x.a, y.a), select(mask.b, x.b, y.b)};
}

template <class P>
GANTRY_INLINE Twin<P> operator-(const Twin<P>& x) {
  return {-x.a, -x.b};
}

#define GANTRY_TWIN_FUNCTION(name)               \
  template <class P>                             \
  GANTRY_INLINE Twin<P> name(const Twin<P>& x) { \
    return {name(x.a), name(x.b)};               \
  }
GANTRY_TWIN_FUNCTION(vabs)
GANTRY_TWIN_FUNCTION(vsqrt)
GANTRY_TWIN_FUNCTION(pow2)
#undef GANTRY_TWIN_FUNCTION

template <class P>
constexpr int kLanes<Twin<P>> = 2 * kLanes<P>;

template <class P>
GANTRY_INLINE double lane(const Twin<P>& x, int k) {
  return k < kLanes<P> ? lane(x.a, k) : lane(x.b, k - kLanes<P>);
}
template <class P>
GANTRY_INLINE bool lane(const TwinMask<P>& x, int k) {
  return k < kLanes<P> ? lane(x.a, k) : lane(x.b, k - kLanes<P>);
}
template <class P>
GANTRY_INLINE void set_lane(Twin<P>& x, int k, double value) {
  k < kLanes<P> ? set_lane(x.a, k, value) : set_lane(x.b, k - kLanes<P>, value);
}
template <class P>
GANTRY_INLINE void set_lane(TwinMask<P>& x, int k, bool value) {
  k < kLanes<P> ? set_lane(x.a, k, value) : set_lane(x.b, k - kLanes<P>, value);
}

}  // namespace gantry::GANTRY_ISA
