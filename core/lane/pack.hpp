// A pack of N plants: the same arithmetic lane by lane. On the compiler's vector types where it has them
// (GCC, Clang), N being what a register of the instruction set holds: wider packs spill. Elsewhere loops,
// same bits.
#pragma once

#include "core/lane/lane.hpp"

#if !defined(GANTRY_LOOP_PACKS) && (defined(__GNUC__) || defined(__clang__))
#define GANTRY_VECTOR_PACKS 1
#endif
#if defined(GANTRY_VECTOR_PACKS) && (defined(__SSE2__) || defined(__AVX2__))
#include <immintrin.h>
#endif

namespace gantry::GANTRY_ISA {

#if defined(GANTRY_VECTOR_PACKS)

template <int N>
struct Mask {
  typedef std::int64_t Bits __attribute__((vector_size(8 * N)));
  Bits lane;  // all bits of a lane set, or none
};

template <int N>
struct Pack {
  typedef double Numbers __attribute__((vector_size(8 * N)));
  Numbers lane;
  Pack() = default;
  GANTRY_INLINE Pack(double x) : lane(x - Numbers{}) {}  // NOLINT: a number is a pack of equal numbers
};

// (GCC cannot tell a constructor from such a vector apart from the one above.)
template <int N>
GANTRY_INLINE Pack<N> pack_of(typename Pack<N>::Numbers numbers) {
  Pack<N> pack;
  pack.lane = numbers;
  return pack;
}

#define GANTRY_PACK_OP(op)                                                \
  template <int N>                                                        \
  GANTRY_INLINE Pack<N> operator op(const Pack<N>& a, const Pack<N>& b) { \
    return pack_of<N>(a.lane op b.lane);                                  \
  }
#define GANTRY_PACK_COMPARE(op)                                           \
  template <int N>                                                        \
  GANTRY_INLINE Mask<N> operator op(const Pack<N>& a, const Pack<N>& b) { \
    return {(typename Mask<N>::Bits)(a.lane op b.lane)};                  \
  }
#define GANTRY_MASK_OP(name, op)                                   \
  template <int N>                                                 \
  GANTRY_INLINE Mask<N> name(const Mask<N>& a, const Mask<N>& b) { \
    return {a.lane op b.lane};                                     \
  }
GANTRY_MASK_OP(both, &)
GANTRY_MASK_OP(either, |)
GANTRY_MASK_OP(differ, ^)
#undef GANTRY_MASK_OP

template <int N>
GANTRY_INLINE Mask<N> negate(const Mask<N>& a) {
  return {~a.lane};
}

template <int N>
GANTRY_INLINE Pack<N> operator-(const Pack<N>& a) {
  return pack_of<N>(-a.lane);
}

template <int N>
GANTRY_INLINE Pack<N> select(const Mask<N>& mask, const Pack<N>& a, const Pack<N>& b) {
  return pack_of<N>(mask.lane ? a.lane : b.lane);
}

template <int N>
GANTRY_INLINE bool any(const Mask<N>& mask) {
#if defined(__AVX512DQ__)
  if constexpr (N == 8) return _mm512_movepi64_mask((__m512i)mask.lane) != 0;
#endif
#if defined(__AVX2__)
  if constexpr (N == 4) return _mm256_movemask_pd((__m256d)mask.lane) != 0;
#endif
#if defined(__SSE2__)
  if constexpr (N == 2) return _mm_movemask_pd((__m128d)mask.lane) != 0;
#endif
  std::int64_t bits = 0;
  for (int k = 0; k < N; ++k) bits |= mask.lane[k];
  return bits != 0;
}

template <int N>
GANTRY_INLINE Pack<N> vabs(const Pack<N>& a) {
  using Bits = typename Mask<N>::Bits;
  return pack_of<N>((typename Pack<N>::Numbers)((Bits)a.lane & ~((Bits) - typename Pack<N>::Numbers{})));
}

template <int N>
GANTRY_INLINE Pack<N> pow2(const Pack<N>& n) {
  using Bits = typename Mask<N>::Bits;
  const Bits shifted = (Bits)(n + Pack<N>(6755399441055744.0)).lane;
  return pack_of<N>((typename Pack<N>::Numbers)((shifted + 1023) << 52));
}

template <int N>
GANTRY_INLINE void set_lane(Mask<N>& mask, int k, bool value) {
  mask.lane[k] = value ? -1 : 0;
}

#else

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
  }
#define GANTRY_PACK_COMPARE(op)                                     \
  template <int N>                                                  \
  Mask<N> operator op(const Pack<N>& a, const Pack<N>& b) {         \
    Mask<N> m;                                                      \
    for (int k = 0; k < N; ++k) m.lane[k] = a.lane[k] op b.lane[k]; \
    return m;                                                       \
  }
#define GANTRY_MASK_OP(name)                                            \
  template <int N>                                                      \
  Mask<N> name(Mask<N> a, const Mask<N>& b) {                           \
    for (int k = 0; k < N; ++k) a.lane[k] = name(a.lane[k], b.lane[k]); \
    return a;                                                           \
  }
GANTRY_MASK_OP(both)
GANTRY_MASK_OP(either)
GANTRY_MASK_OP(differ)
#undef GANTRY_MASK_OP

template <int N>
Mask<N> negate(Mask<N> a) {
  for (bool& m : a.lane) m = !m;
  return a;
}

template <int N>
Pack<N> operator-(Pack<N> a) {
  for (double& l : a.lane) l = -l;
  return a;
}

template <int N>
Pack<N> select(const Mask<N>& mask, Pack<N> a, const Pack<N>& b) {
  for (int k = 0; k < N; ++k) a.lane[k] = mask.lane[k] ? a.lane[k] : b.lane[k];
  return a;
}

template <int N>
bool any(const Mask<N>& mask) {
  for (bool m : mask.lane)
    if (m) return true;
  return false;
}

template <int N>
void set_lane(Mask<N>& mask, int k, bool value) {
  mask.lane[k] = value;
}

#define GANTRY_PACK_FUNCTION(name)        \
  template <int N>                        \
  Pack<N> name(Pack<N> a) {               \
    for (double& l : a.lane) l = name(l); \
    return a;                             \
  }
GANTRY_PACK_FUNCTION(vabs)
GANTRY_PACK_FUNCTION(pow2)
#undef GANTRY_PACK_FUNCTION

#endif

GANTRY_PACK_OP(+)
GANTRY_PACK_OP(-)
GANTRY_PACK_OP(*)
GANTRY_PACK_OP(/)
GANTRY_PACK_COMPARE(<)
GANTRY_PACK_COMPARE(>)
GANTRY_PACK_COMPARE(<=)
GANTRY_PACK_COMPARE(>=)
GANTRY_PACK_COMPARE(==)
#undef GANTRY_PACK_OP
#undef GANTRY_PACK_COMPARE

template <int N>
GANTRY_INLINE Pack<N> vsqrt(Pack<N> a) {
  for (int k = 0; k < N; ++k) a.lane[k] = std::sqrt(a.lane[k]);
  return a;
}

template <int N>
GANTRY_INLINE double lane(const Pack<N>& pack, int k) {
  return pack.lane[k];
}
template <int N>
GANTRY_INLINE bool lane(const Mask<N>& mask, int k) {
  return mask.lane[k] != 0;
}
template <int N>
GANTRY_INLINE void set_lane(Pack<N>& pack, int k, double value) {
  pack.lane[k] = value;
}
template <int N>
constexpr int kLanes<Pack<N>> = N;

}  // namespace gantry::GANTRY_ISA
