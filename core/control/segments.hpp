// The set-point plan as data: segments of constant jerk, sampled by the scan and by the compiled loop alike.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "core/lane/isa.hpp"

namespace gantry::GANTRY_ISA {

template <class T>
struct SetPoint {
  T pos;
  T vel;
  T acc;
};

class Segments {
 public:
  struct Segment {
    double t_start, pos, vel, acc, jerk;
  };

  Segments() = default;
  Segments(std::vector<Segment> segments, double duration, double pos_end, double vel_end)
      : segments_(std::move(segments)), duration_(duration), pos_end_(pos_end), vel_end_(vel_end) {}

  // The set-point at time t; before the start its first state, after the end the final one (at vel_end for
  // ever).
  SetPoint<double> sample(double t) const {
    if (!(t < duration_) || segments_.empty())
      return {t > duration_ ? pos_end_ + vel_end_ * (t - duration_) : pos_end_, vel_end_, 0.0};
    std::size_t k = segments_.size() - 1;
    while (k > 0 && t < segments_[k].t_start) --k;
    return at(segments_[k], std::max(0.0, t - segments_[k].t_start));
  }

  // Smallest and largest position over 0 <= t <= duration: at the ends of segments and where the speed is
  // zero.
  void extremes(double& lowest, double& highest) const {
    lowest = highest = pos_end_;
    for (std::size_t k = 0; k < segments_.size(); ++k) {
      const Segment& s = segments_[k];
      const double end = k + 1 < segments_.size() ? std::min(segments_[k + 1].t_start, duration_) : duration_;
      const double length = end - s.t_start;
      const auto visit = [&](double dt) {
        if (!(dt >= 0.0 && dt <= length)) return;
        const double pos = at(s, dt).pos;
        lowest = std::min(lowest, pos);
        highest = std::max(highest, pos);
      };
      visit(0.0);
      visit(length);
      // vel + acc dt + jerk dt^2 / 2 = 0, in the form that stays exact when jerk is small
      const double root = std::sqrt(s.acc * s.acc - 2.0 * s.jerk * s.vel);
      const double q = -(s.acc + (s.acc < 0.0 ? -root : root));
      visit(2.0 * s.vel / q);
      visit(q / s.jerk);
    }
  }

  const std::vector<Segment>& segments() const { return segments_; }
  double duration() const { return duration_; }
  double pos_end() const { return pos_end_; }
  double vel_end() const { return vel_end_; }

 private:
  static SetPoint<double> at(const Segment& s, double dt) {
    return {s.pos + dt * (s.vel + dt * (0.5 * s.acc + dt * (s.jerk / 6.0))),
            s.vel + dt * (s.acc + dt * (0.5 * s.jerk)), s.acc + dt * s.jerk};
  }

  std::vector<Segment> segments_;
  double duration_ = 0.0;
  double pos_end_ = 0.0;
  double vel_end_ = 0.0;
};

}  // namespace gantry::GANTRY_ISA
