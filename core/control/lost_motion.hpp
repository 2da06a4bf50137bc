// The backlash from an encoder on the ring: how far the motor goes from flank to flank while the load does
// not.
//
// At constant speed, with D the lead of the motor over the load that the maps do not explain, f = sign(Tg)
// the flank that the load lies on (Tg = M(r) + z F, of the moment and friction in use) and z the direction:
//     D = a + s sin r + c cos r + t z + h f
// h is half of what the backlash has become more than the calibration. The others are wind-up that is not
// that of the calibration, errors of both encoders, friction. Least squares with fading memory; their sums of
// squares say how sure h is.
#pragma once

#include "core/control/backlash_observer.hpp"

namespace gantry::GANTRY_ISA {

constexpr double kFlankKnown = 0.5;  // of all friction: nearer to 0 the flank is not known, as in the watch
constexpr double kLeadMax = 1.0;     // rad: a load further off its motor is no load
constexpr double kLeadRidge =
    1e-4;  // variance of a sample, of 10 um on the ring, over that of an unknown: 1 mm
constexpr double kSamplesMin = 2.0;  // samples that say something, per unknown
constexpr double kSure = 3.0;        // standard deviations by which the backlash in use stays behind

// Change of the backlash, and its standard deviation.
template <class T>
struct BacklashSeen {
  T change_rad;
  T deviation_rad;
};

// Scans within half a swing say the same once.
template <class T>
T alike_scans(const CompensationParams<T>& p) {
  return T(3.14159265358979323846) / (p.swing_rad_s * p.period_s);
}

// What the sums say: elimination of the symmetric equations, the flank last; what is left of the square of
// the lead is that of the residuals.
template <class T>
BacklashSeen<T> lost_motion_seen(const CompensationParams<T>& p, const CompensationState<T>& s) {
  std::array<std::array<T, kLeadColumns>, kLeadColumns> a;
  int next = 0;
  for (int i = 0; i < kLeadColumns; ++i)
    for (int j = i; j < kLeadColumns; ++j) a[i][j] = s.lead_sums[next++];
  const T scans = a[0][0];
  for (int i = 0; i + 1 < kLeadColumns; ++i) a[i][i] = a[i][i] + T(kLeadRidge);
  for (int k = 0; k + 1 < kLeadColumns; ++k)
    for (int i = k + 1; i < kLeadColumns; ++i) {
      const T part = a[k][i] / a[k][k];
      for (int j = i; j < kLeadColumns; ++j) a[i][j] = a[i][j] - part * a[k][j];
    }
  constexpr int kFlank = kLeadColumns - 2, kLeft = kLeadColumns - 1;
  const T left = select(a[kLeft][kLeft] > T(0.0), a[kLeft][kLeft], T(0.0));
  const T alike = alike_scans(p);
  const auto enough = scans > T(kSamplesMin * (kLeadColumns - 1)) * alike;
  const T variance = left / scans * alike / a[kFlank][kFlank];
  return {T(2.0) * (a[kFlank][kLeft] / a[kFlank][kFlank]),
          select(enough, T(2.0) * vsqrt(variance), T(kLeadMax))};
}

// A scan of motion: `apart` is the load-side reading less the angle that motor encoder and maps give.
template <class T>
void observe_lost_motion(const CompensationParams<T>& p, const Moment<T>& m, const SetPoint<T>& r, T apart,
                         CompensationState<T>& s) {
  const SinCos<T> x = sincos(r.pos);
  const T z = sign(r.vel);
  const T mesh = m.sine_nm * x.sin + m.cosine_nm * x.cos + z * friction_load_now(p, s);
  const T side = sign(mesh);
  const auto steady = both(vabs(r.vel) > p.observer_speed_rad_s, s.direction * z == T(1.0));
  const auto lies = both(r.acc == T(0.0), vabs(mesh) > T(kFlankKnown) * p.friction_nm);
  const auto heard = both(steady, vabs(apart) < T(kLeadMax));  // false of NaN
  const auto tells = both(both(heard, lies), moment_known(p, s));
  const T lead = select(tells, T(0.5) * s.backlash_change_rad * side - apart, T(0.0));
  const std::array<T, kLeadColumns> row{T(1.0), x.sin, x.cos, z, side, lead};
  const T taken = select(tells, T(1.0), T(0.0));
  const T kept = select(tells, p.backlash_memory, T(1.0));
  int next = 0;
  for (int i = 0; i < kLeadColumns; ++i)
    for (int j = i; j < kLeadColumns; ++j) {
      s.lead_sums[next] = kept * s.lead_sums[next] + taken * (row[i] * row[j]);
      ++next;
    }
  use_friction(p, heard, s);
}

// At the end of a move the backlash in use goes towards what is seen, as near as its standard deviation
// permits and within the limit that a person has set. What the maps then lead by more or less at this
// set-point, the load-side loop gives back in the same scan, so the motor stands still; and what the damping
// knows as the resting twist goes with it.
template <class T>
void use_lost_motion(const CompensationParams<T>& p, const Moment<T>& m, const Flank<T>& flank,
                     const SetPoint<T>& r, CompensationState<T>& s) {
  const T zero = T(0.0);
  const auto rests = both(r.vel == zero, r.acc == zero);
  const auto ended = both(rests, s.moved > zero);
  s.moved = select(rests, zero, T(1.0));
  if (!any(ended)) return;
  const BacklashSeen<T> seen = lost_motion_seen(p, s);
  const T widest = T(static_cast<double>(kBacklashModels - 1)) * p.backlash_step_rad;
  const T apart =
      clamp(seen.change_rad, -p.backlash_held_rad, widest - p.backlash_held_rad) - s.backlash_change_rad;
  const T unsure = T(kSure) * seen.deviation_rad;
  const T step = apart - clamp(apart, -unsure, unsure);
  const Flank<T> then{flank.backlash_rad + step, flank.friction_nm, flank.gone_nm};
  const T lead = map_correction(p, m, then, s.direction, zero, r.pos, zero, zero, zero).pos -
                 map_correction(p, m, flank, s.direction, zero, r.pos, zero, zero, zero).pos;
  const T twist = backlash_correction(p, m, then, s.direction, zero, r.pos, zero, zero, zero).pos -
                  backlash_correction(p, m, flank, s.direction, zero, r.pos, zero, zero, zero).pos;
  const auto given = both(ended, vabs(s.bias_rad - lead) <= p.encoder_limit_rad);  // false of NaN
  s.backlash_change_rad = select(given, s.backlash_change_rad + step, s.backlash_change_rad);
  s.bias_rad = select(given, s.bias_rad - lead, s.bias_rad);
  s.twist_slow_rad = select(given, s.twist_slow_rad - twist, s.twist_slow_rad);
}

}  // namespace gantry::GANTRY_ISA
