// Elasto-plastic friction (plant equations S3, S4; Dupont et al. 2002): one element for rollers, motor and
// brake.
#pragma once

#include "core/lane/elementary.hpp"

namespace gantry::GANTRY_ISA {

// How far the element slides: 0 elastic, 1 sliding, a sine blend between ep_ratio and 1.
// inverse = 1/z_ss, z_ss being the state at which it slides steadily.
template <class T>
GANTRY_INLINE T sliding_gate(T v, T z, T inverse, T ep_ratio) {
  const T a = vabs(z) * inverse;
  const auto loading = v * z > T(0.0);
  const auto blending = both(loading, both(a > ep_ratio, a < T(1.0)));
  T gate = select(both(loading, a >= T(1.0)), T(1.0), T(0.0));
  if (any(blending)) {
    constexpr double kPi = 3.141592653589793;
    const T x = T(kPi) * (a - T(0.5) * (T(1.0) + ep_ratio)) / (T(1.0) - ep_ratio);
    gate = select(blending, T(0.5) + T(0.5) * sincos(x).sin, gate);
  }
  return gate;
}

template <class T>
struct FrictionParams {
  T coulomb, breakaway, viscous;
  T stiffness;         // sigma0
  T damping;           // sigma1 at standstill
  T stribeck_inverse;  // 1 / (5 vs)

  FrictionParams() = default;
  // Without Coulomb friction there is no spring either, only the viscous part; its level must not be 0 / 0.
  FrictionParams(T coulomb_, T breakaway_, T stribeck, T viscous_, T presliding, T micro_damping, T inertia)
      : coulomb(select(coulomb_ > T(0.0), coulomb_, T(1e-300))),
        breakaway(select(breakaway_ > T(0.0), breakaway_, T(1e-300))),
        viscous(viscous_),
        stiffness(coulomb_ / presliding),
        damping(micro_damping * vsqrt(stiffness * inertia)),
        stribeck_inverse(T(1.0) / (T(5.0) * stribeck)) {}
};

template <class T>
struct Friction {
  T torque = T(0.0);
  T z_rate = T(0.0);     // z'
  T slip_rate = T(0.0);  // lambda = alpha |v| / z_ss: z' = v - lambda z
};

// sigma1 falls with speed as exp(-(v/5 vs)^2) and the Stribeck term is its 25th power: one exponential serves
// both. Beyond an exponent of 28 both are below 1e-12 of themselves and taken as zero.
template <class T>
GANTRY_INLINE Friction<T> friction(const FrictionParams<T>& p, T v, T z, T load_torque, T ep_ratio) {
  const T x = v * p.stribeck_inverse;
  const T exponent = x * x;
  const auto fast = exponent > T(28.0);
  T slow = T(0.0);
  if (any(negate(fast))) slow = select(fast, T(0.0), vexp(-exponent));
  const T s2 = slow * slow;
  const T s4 = s2 * s2;
  const T s8 = s4 * s4;
  const T stribeck = s8 * s8 * s8 * slow;
  const T g = p.coulomb + (p.breakaway - p.coulomb) * stribeck + load_torque;
  const T inverse = p.stiffness / g;  // 1/z_ss
  Friction<T> f;
  f.slip_rate = sliding_gate(v, z, inverse, ep_ratio) * vabs(v) * inverse;
  f.z_rate = v - f.slip_rate * z;
  f.torque = p.stiffness * z + p.damping * slow * f.z_rate + p.viscous * v;
  return f;
}

// Exact step of z' = v - lambda z with v and lambda held (S9).
template <class T>
GANTRY_INLINE T friction_step(T z, const Friction<T>& f, T dt) {
  const T x = f.slip_rate * dt;
  const auto sliding = x >= T(1e-5);
  T length = dt;
  if (any(sliding)) length = select(sliding, (T(1.0) - vexp(-x)) / select(sliding, f.slip_rate, T(1.0)), dt);
  return z + f.z_rate * length;
}

}  // namespace gantry::GANTRY_ISA
