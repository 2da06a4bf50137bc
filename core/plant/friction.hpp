// Elasto-plastic friction (plant equations S3, S4; Dupont et al. 2002): one element for rollers, motor and
// brake.
#pragma once

#include "core/lane/elementary.hpp"

namespace gantry::GANTRY_ISA {

// How far the element slides: 0 elastic, 1 sliding, a sine blend between ep_ratio and 1.
// inverse = 1/z_ss, z_ss being the state at which it slides steadily.
template <class T>
struct Gate {
  T ep_ratio;
  T middle;         // of the blend
  T width_inverse;  // of the blend

  GANTRY_INLINE T operator()(T v, T z, T inverse) const {
    const T a = vabs(z) * inverse;
    const auto loading = v * z > T(0.0);
    const auto blending = both(loading, both(a > ep_ratio, a < T(1.0)));
    T gate = select(both(loading, a >= T(1.0)), T(1.0), T(0.0));
    if (any(blending)) gate = select(blending, T(0.5) + T(0.5) * sin_pi((a - middle) * width_inverse), gate);
    return gate;
  }
};

template <class T>
Gate<T> gate_of(T ep_ratio) {
  return {ep_ratio, T(0.5) * (T(1.0) + ep_ratio), T(1.0) / (T(1.0) - ep_ratio)};
}

template <class T>
struct FrictionParams {
  T coulomb, breakaway, viscous;
  T stiffness;         // sigma0
  T damping;           // sigma1 at standstill
  T stribeck_inverse;  // 1 / (5 vs)
  T coulomb_inverse;   // 1/z_ss at Coulomb friction alone

  FrictionParams() = default;
  // Without Coulomb friction there is no spring either, only the viscous part; its level must not be 0 / 0.
  FrictionParams(T coulomb_, T breakaway_, T stribeck, T viscous_, T presliding, T micro_damping, T inertia)
      : coulomb(select(coulomb_ > T(0.0), coulomb_, T(1e-300))),
        breakaway(select(breakaway_ > T(0.0), breakaway_, T(1e-300))),
        viscous(viscous_),
        stiffness(coulomb_ / presliding),
        damping(micro_damping * vsqrt(stiffness * inertia)),
        stribeck_inverse(T(1.0) / (T(5.0) * stribeck)),
        coulomb_inverse(stiffness / coulomb) {}
};

template <class T>
struct Friction {
  T torque = T(0.0);
  T z_rate = T(0.0);     // z'
  T slip_rate = T(0.0);  // lambda = alpha |v| / z_ss: z' = v - lambda z
};

// sigma1 falls with speed as exp(-(v/5 vs)^2) and the Stribeck term is its 25th power: one exponential serves
// both. Beyond an exponent of 28 both are below 1e-12 of themselves and taken as zero. kLoaded: `load_torque`
// is more than 0; otherwise the level at speed is the Coulomb friction, whose inverse is known.
template <bool kLoaded, class T>
GANTRY_INLINE Friction<T> friction(const FrictionParams<T>& p, const Gate<T>& gate, T v, T z,
                                   T load_torque = T(0.0)) {
  const T x = v * p.stribeck_inverse;
  const T exponent = x * x;
  const auto fast = exponent > T(28.0);
  const bool some_slow = any(negate(fast));
  T level = p.coulomb;
  if constexpr (kLoaded) level = level + load_torque;
  T damping = T(0.0);
  if (some_slow) {
    const T slow = select(fast, T(0.0), vexp(-exponent));
    const T s2 = slow * slow;
    const T s4 = s2 * s2;
    const T s8 = s4 * s4;
    level = level + (p.breakaway - p.coulomb) * (s8 * s8 * s8 * slow);
    damping = p.damping * slow;
  }
  const T inverse = kLoaded || some_slow ? p.stiffness / level : p.coulomb_inverse;  // 1/z_ss
  Friction<T> f;
  f.slip_rate = gate(v, z, inverse) * vabs(v) * inverse;
  f.z_rate = v - f.slip_rate * z;
  f.torque = p.stiffness * z + damping * f.z_rate + p.viscous * v;
  return f;
}

// (1 - exp(-x))/x for 0 <= x <= 4, error below 1e-13, 1 at 0: a polynomial for x/8, then three times
// f(2y) = f(y) (1 - y f(y)/2).
template <class T>
GANTRY_INLINE T decayed_mean(T x) {
  const T y = T(0.125) * x;
  const T y2 = y * y;
  const T y4 = y2 * y2;
  const T low = (T(0x1.ffffffffffe12p-2) - T(0x1.55555555178bap-3) * y) +
                (T(0x1.5555552cb5e70p-5) - T(0x1.111106dfeb0b9p-7) * y) * y2;
  const T high = (T(0x1.6c143cf187536p-10) - T(0x1.9fc338cc97324p-13) * y) +
                 (T(0x1.999425b15cc51p-16) - T(0x1.2f4d81da4ed70p-19) * y) * y2;
  const T one = T(1.0) - y * (low + high * y4);
  const T two = one * (T(1.0) - (T(0.5) * y) * one);
  const T four = two * (T(1.0) - y * two);
  return four * (T(1.0) - (y + y) * four);
}

// Exact step of z' = v - lambda z with v and lambda held (S9).
template <class T>
GANTRY_INLINE T friction_step(T z, const Friction<T>& f, T dt) {
  const T x = f.slip_rate * dt;
  T mean = T(1.0);
  if (any(x > T(0.0))) {
    mean = decayed_mean(x);
    const auto far = x > T(4.0);
    if (any(far)) mean = select(far, (T(1.0) - vexp(-x)) / x, mean);
  }
  return z + f.z_rate * (dt * mean);
}

// How the age of a contact changes: it grows to 1 with a time constant and is lost over a way of sliding. The
// same form as z' = v - lambda z, and the same exact step.
template <class T>
GANTRY_INLINE Friction<T> ageing(const Friction<T>& f, T z, T age, T time_s, T length) {
  const T fresh = T(1.0) / time_s;
  Friction<T> a;
  a.slip_rate = fresh + f.slip_rate * vabs(z) / length;
  a.z_rate = fresh - a.slip_rate * age;
  return a;
}

}  // namespace gantry::GANTRY_ISA
