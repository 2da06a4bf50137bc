// A number that counts what is done with it: how much arithmetic a drive cycle takes.
#pragma once

#include "core/lane/lane.hpp"

namespace gantry::GANTRY_ISA {

// Additions and subtractions, multiplications, divisions; comparisons and choices, which are no arithmetic.
struct Operations {
  long add = 0;
  long multiply = 0;
  long divide = 0;
  long choose = 0;

  long arithmetic() const { return add + multiply + divide; }
};

inline thread_local Operations operations;

struct Counted {
  double value;
  Counted() = default;
  Counted(double x) : value(x) {}  // NOLINT: as any lane type is made from a number
};

#define GANTRY_COUNTED(op, kind)                     \
  inline Counted operator op(Counted a, Counted b) { \
    ++operations.kind;                               \
    return a.value op b.value;                       \
  }
GANTRY_COUNTED(+, add)
GANTRY_COUNTED(-, add)
GANTRY_COUNTED(*, multiply)
GANTRY_COUNTED(/, divide)
#undef GANTRY_COUNTED
#define GANTRY_COUNTED(op)                        \
  inline bool operator op(Counted a, Counted b) { \
    ++operations.choose;                          \
    return a.value op b.value;                    \
  }
GANTRY_COUNTED(<)
GANTRY_COUNTED(>)
GANTRY_COUNTED(<=)
GANTRY_COUNTED(>=)
GANTRY_COUNTED(==)
#undef GANTRY_COUNTED

inline Counted operator-(Counted a) { return -a.value; }
inline Counted select(bool mask, Counted a, Counted b) {
  ++operations.choose;
  return mask ? a : b;
}
inline Counted vabs(Counted x) { return vabs(x.value); }
inline Counted vsqrt(Counted x) {
  ++operations.divide;
  return vsqrt(x.value);
}
inline Counted pow2(Counted n) {
  ++operations.add;
  return pow2(n.value);
}
inline double lane(Counted x, int) { return x.value; }
inline void set_lane(Counted& x, int, double value) { x.value = value; }

}  // namespace gantry::GANTRY_ISA
