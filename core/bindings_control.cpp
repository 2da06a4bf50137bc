#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <stdexcept>
#include <tuple>

#include "core/bindings.hpp"
#include "core/control/position_law.hpp"
#include "core/control/segments.hpp"

namespace nb = nanobind;
using namespace gantry;
using Row = std::tuple<double, double, double>;
using Column = std::vector<double>;

namespace {

Segments make_segments(const Column& t_start, const Column& pos, const Column& vel, const Column& acc,
                       const Column& jerk, double duration, double pos_end, double vel_end) {
  const std::size_t n = t_start.size();
  if (pos.size() != n || vel.size() != n || acc.size() != n || jerk.size() != n)
    throw std::invalid_argument("Segments: the five columns must have one length");
  std::vector<Segments::Segment> segments;
  for (std::size_t k = 0; k < n; ++k) {
    const Segments::Segment s{t_start[k], pos[k], vel[k], acc[k], jerk[k]};
    if (!(std::isfinite(s.t_start) && std::isfinite(s.pos) && std::isfinite(s.vel) && std::isfinite(s.acc) &&
          std::isfinite(s.jerk)))
      throw std::invalid_argument("Segments: a value is not finite");
    if (k > 0 && s.t_start < segments.back().t_start)
      throw std::invalid_argument("Segments: t_start must not fall");
    segments.push_back(s);
  }
  if (!(std::isfinite(duration) && duration >= 0.0 && std::isfinite(pos_end) && std::isfinite(vel_end)))
    throw std::invalid_argument(
        "Segments: duration, pos_end and vel_end must be finite, duration not negative");
  return {std::move(segments), duration, pos_end, vel_end};
}

template <class Get>
Column column(const Segments& s, Get get) {
  Column values;
  for (const Segments::Segment& segment : s.segments()) values.push_back(get(segment));
  return values;
}

PositionLawParams<double> make_law(double kpp_per_s, double kvf, double ratio, double counts_per_turn,
                                   double vel_max_rad_s) {
  constexpr double kTwoPi = 6.283185307179586;
  for (double x : {kpp_per_s, kvf, ratio, counts_per_turn, vel_max_rad_s})
    if (!std::isfinite(x)) throw std::invalid_argument("PositionLaw: a parameter is not finite");
  if (!(ratio > 0.0 && counts_per_turn > 0.0 && vel_max_rad_s > 0.0))
    throw std::invalid_argument("PositionLaw: ratio, counts_per_turn and vel_max_rad_s must be positive");
  return {kpp_per_s, kvf, ratio, kTwoPi / counts_per_turn, vel_max_rad_s};
}

}  // namespace

void bind_control(nb::module_& m) {
  nb::class_<Segments>(m, "Segments", "A set-point plan: segments of constant jerk from t = 0.")
      .def(
          "__init__",
          [](Segments* self, const Column& t_start, const Column& pos, const Column& vel, const Column& acc,
             const Column& jerk, double duration, double pos_end, double vel_end) {
            new (self) Segments(make_segments(t_start, pos, vel, acc, jerk, duration, pos_end, vel_end));
          },
          nb::arg("t_start"), nb::arg("pos"), nb::arg("vel"), nb::arg("acc"), nb::arg("jerk"),
          nb::arg("duration"), nb::arg("pos_end"), nb::arg("vel_end"))
      .def(
          "sample",
          [](const Segments& s, double t) {
            const SetPoint<double> r = s.sample(t);
            return Row(r.pos, r.vel, r.acc);
          },
          nb::arg("t"),
          "Position, speed and acceleration at time t, s; after the end pos_end + vel_end (t - duration).")
      .def(
          "extremes",
          [](const Segments& s) {
            double lowest, highest;
            s.extremes(lowest, highest);
            return std::make_tuple(lowest, highest);
          },
          "Smallest and largest position over 0 <= t <= duration.")
      .def_prop_ro("duration", &Segments::duration)
      .def_prop_ro("pos_end", &Segments::pos_end)
      .def_prop_ro("vel_end", &Segments::vel_end)
      .def_prop_ro("t_start", [](const Segments& s) { return column(s, [](auto& x) { return x.t_start; }); })
      .def_prop_ro("pos", [](const Segments& s) { return column(s, [](auto& x) { return x.pos; }); })
      .def_prop_ro("vel", [](const Segments& s) { return column(s, [](auto& x) { return x.vel; }); })
      .def_prop_ro("acc", [](const Segments& s) { return column(s, [](auto& x) { return x.acc; }); })
      .def_prop_ro("jerk", [](const Segments& s) { return column(s, [](auto& x) { return x.jerk; }); });

  nb::class_<PositionLawParams<double>>(
      m, "PositionLaw", "P position loop with velocity feed-forward: v = Kpp (i r - y) + Kvf i r'.")
      .def(
          "__init__",
          [](PositionLawParams<double>* self, double kpp_per_s, double kvf, double ratio,
             double counts_per_turn, double vel_max_rad_s) {
            new (self)
                PositionLawParams<double>(make_law(kpp_per_s, kvf, ratio, counts_per_turn, vel_max_rad_s));
          },
          nb::arg("kpp_per_s"), nb::arg("kvf"), nb::arg("ratio"), nb::arg("counts_per_turn"),
          nb::arg("vel_max_rad_s"))
      .def(
          "scan",
          [](const PositionLawParams<double>& p, double pos_ref_rad, double vel_ref_rad_s, double counts) {
            const auto r = position_law(p, pos_ref_rad, vel_ref_rad_s, counts);
            return Row(r.vel_cmd_rad_s, r.pos_act_rad, r.pos_err_rad);
          },
          nb::arg("pos_ref_rad"), nb::arg("vel_ref_rad_s"), nb::arg("counts"),
          "Speed command (motor side, clamped), actual position and following error (gantry side).\n\n"
          "counts is the encoder count minus its zero offset. NaN passes through the clamp.")
      .def_ro("kpp_per_s", &PositionLawParams<double>::kpp_per_s)
      .def_ro("kvf", &PositionLawParams<double>::kvf)
      .def_ro("ratio", &PositionLawParams<double>::ratio)
      .def_ro("rad_per_count", &PositionLawParams<double>::rad_per_count)
      .def_ro("vel_max_rad_s", &PositionLawParams<double>::vel_max_rad_s);
}
