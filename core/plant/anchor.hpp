// Waves of the plant near an anchor. They are evaluated in full at most once in a millisecond and continued
// from there: in it the load turns less than 1e-3 rad, the motor some tenths.
#pragma once

#include "core/plant/gear_error.hpp"
#include "core/plant/params.hpp"
#include "core/plant/thermal.hpp"
#include "core/plant/tooth_pitch.hpp"

namespace gantry::GANTRY_ISA {

// Torque of the eccentric moment on the load; the sine to the third order, 1e-13 of it after 1e-3 rad.
template <class T>
class EccentricTorque {
 public:
  EccentricTorque(const PlantParams<T>& p, T pos_load) : pos_(pos_load) {
    const SinCos<T> s = sincos(pos_load - p.eccentric_angle_rad);
    value_ = p.eccentric_moment_nm * s.sin;
    slope_ = p.eccentric_moment_nm * s.cos;
  }

  GANTRY_INLINE T operator()(T pos_load) const {
    const SinCos<T> by = sincos_small<2>(pos_load - pos_);
    return value_ * by.cos + slope_ * by.sin;
  }

 private:
  T pos_, value_, slope_;
};

// What passes with the motor: its own turn, the pinion's and its teeth. Continued by the addition theorem,
// with sine and cosine of the way by their series, exact to 1e-10 of each wave within the reach.
template <class T>
struct MotorWaves {
  T pos = T(0.0);
  SinCos<T> motor{T(0.0), T(1.0)};
  ErrorValue<T> turn, tooth;

  MotorWaves() = default;
  MotorWaves(const GearError<T>& gear, T pos_motor) : pos(pos_motor), motor(sincos(pos_motor)) {
    const T pinion_angle = pos_motor * gear.pinion_per_motor;
    turn = gear.pinion.at(pinion_angle);
    tooth = gear.mesh.at(pinion_angle * gear.teeth);
  }

  // Begins anew in the lanes where the motor has left the reach: a motor out of control.
  GANTRY_INLINE void reach(const GearError<T>& gear, T pos_motor) {
    const auto far = vabs(pos_motor - pos) > gear.reach;
    if (!any(far)) return;
    const MotorWaves fresh(gear, pos_motor);
    const auto take = [far](T& old, T other) { old = select(far, other, old); };
    take(pos, fresh.pos);
    take(motor.sin, fresh.motor.sin);
    take(motor.cos, fresh.motor.cos);
    take(turn.error, fresh.turn.error);
    take(turn.slope, fresh.turn.slope);
    take(tooth.error, fresh.tooth.error);
    take(tooth.slope, fresh.tooth.slope);
  }
};

// Moment of the wind on the load, a time after the start: its mean and a sum of waves, which rise within the
// first ten seconds, so that a standing axis is not struck at once.
template <class T>
T wind_moment(const PlantParams<T>& p, T time) {
  constexpr double kRise = 10.0;  // s
  T gust = T(0.0);
  for (std::size_t n = 0; n < kWindWaves; ++n)
    gust = gust + p.wind_wave_nm[n] * sincos(p.wind_rate_rad_s[n] * time + p.wind_phase_rad[n]).sin;
  return p.wind_moment_nm + gust * smaller(time * T(1.0 / kRise), T(1.0));
}

// What one motor with its reducer and pinion passes: the ring at the angle where the pinion meets it, the
// pinion's own teeth, the waves of the motor.
template <class T>
struct TrainAnchor {
  RingError<T> ring;
  RingError<T> pinion_pitch;
  MotorWaves<T> waves;

  TrainAnchor() = default;
  TrainAnchor(const PlantParams<T>& p, const GearError<T>& gear, Pinion pinion, T ring_angle, T pos_motor) {
    if (p.gear_error) ring = gear.ring_error(ring_angle);
    if (p.tooth_pitch) add_teeth(p, pinion, ring_angle, pos_motor);
    if (p.gear_error || p.ripple || p.cogging) waves = MotorWaves<T>(gear, pos_motor);
  }

 private:
  void add_teeth(const PlantParams<T>& p, Pinion pinion, T ring_angle, T pos_motor) {
    const RingError<T> pitch = ring_pitch_error(p, ring_angle);
    ring = {pitch.rho, ring.error + pitch.error, ring.slope + pitch.slope, ring.curvature + pitch.curvature};
    pinion_pitch = pinion_pitch_error(p, pos_motor, pinion);
  }
};

template <class T>
struct Anchor {
  EccentricTorque<T> eccentric;
  T wind = T(0.0);     // held until the next anchor: the fastest gust takes a hundred of them
  Thermal<T> thermal;  // likewise
  TrainAnchor<T> first;
  TrainAnchor<T> second;  // where there is a second pinion

  // `second_gear`: gear error of the second motor's side; not looked at without one.
  Anchor(const PlantParams<T>& p, const GearError<T>& gear, const GearError<T>& second_gear,
         const PlantState<T>& x, T time)
      : eccentric(p, x.pos_load),
        thermal(p, time),
        first(p, gear, Pinion::kFirst, x.pos_load - x.pos_base, x.pos_motor) {
    if (p.wind) wind = wind_moment(p, time);
    if (p.second_pinion)
      second = TrainAnchor<T>(p, second_gear, Pinion::kSecond, (x.pos_load - x.pos_base) + p.second_angle_rad,
                              x.pos_motor_2);
  }
};

}  // namespace gantry::GANTRY_ISA
