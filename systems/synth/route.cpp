// SPDX-License-Identifier: Apache-2.0
#include "synth/route.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"

namespace slambed::synth {
namespace {

constexpr double kStep_m = 0.25;
constexpr double kTwoPi = 6.283185307179586;

double whole_part(double x) { return std::floor(x); }

/// Smooth step from 0 to 1 whose rate is a raised cosine.
double eased(double u) {
  u = std::clamp(u, 0.0, 1.0);
  return u - sincos_turns(u).sin / kTwoPi;
}

}  // namespace

bool is_route(const std::string& name) {
  return name == "rectangle" || name == "circular" || name == "block";
}

Route::Route(const std::string& name) {
  if (name == "circular") {
    length_m_ = 1450;
    constant_turns_ = 1;
    waves_ = {{4, 0.05, 0.1}, {10, 0.06, 0.3}, {18, 0.035, 0.7}};
  } else if (name == "rectangle" || name == "block") {
    // Half a lap: a long side, a turn, a short side, a turn.
    const bool large = name == "rectangle";
    length_m_ = large ? 598 : 90;
    const double turn_m =
        large ? 26 : 17;  // arc length of a turn; its tightest radius is this / pi
    const double long_m = large ? 160 : 8;
    const double short_m = 0.5 * length_m_ - 2 * turn_m - long_m;
    const double half_side_m = 0.5 * long_m;  // the start line lies in the middle of a long side
    for (const double half : {0.0, 0.5 * length_m_}) {
      turns_.push_back({half + half_side_m, turn_m, -0.25});
      turns_.push_back({half + half_side_m + turn_m + short_m, turn_m, -0.25});
    }
  } else {
    throw bad_input("route '" + name + "' is not known; choose rectangle, circular or block");
  }
  const int steps = static_cast<int>(std::ceil(length_m_ / kStep_m));
  places_.push_back(Vec3::Zero());
  for (int i = 0; i < steps; ++i) places_.push_back(step(places_.back(), i * kStep_m, kStep_m));
}

double Route::heading_turns(double s_m) const {
  const double laps = whole_part(s_m / length_m_);
  const double s = s_m - laps * length_m_;
  double lap = constant_turns_, heading = constant_turns_ * s / length_m_;
  for (const Turn& turn : turns_) {
    lap += turn.turns;
    heading += turn.turns * eased((s - turn.begin_m) / turn.length_m);
  }
  for (const Wave& wave : waves_)
    heading += wave.turns * sincos_turns(wave.per_lap * s / length_m_ + wave.phase).sin;
  return laps * lap + heading;
}

double Route::curvature(double s_m) const {
  const double s = s_m - whole_part(s_m / length_m_) * length_m_;
  double rate = constant_turns_ / length_m_;
  for (const Turn& turn : turns_) {
    const double u = (s - turn.begin_m) / turn.length_m;
    if (u > 0 && u < 1) rate += turn.turns / turn.length_m * (1 - sincos_turns(u).cos);
  }
  for (const Wave& wave : waves_)
    rate += wave.turns * kTwoPi * wave.per_lap / length_m_ *
            sincos_turns(wave.per_lap * s / length_m_ + wave.phase).cos;
  return kTwoPi * rate;
}

/// Integrates the heading by Simpson's rule.
Vec3 Route::step(const Vec3& from, double s_m, double length_m) const {
  const SinCos a = sincos_turns(heading_turns(s_m));
  const SinCos b = sincos_turns(heading_turns(s_m + 0.5 * length_m));
  const SinCos c = sincos_turns(heading_turns(s_m + length_m));
  return from + length_m / 6 * Vec3(a.cos + 4 * b.cos + c.cos, a.sin + 4 * b.sin + c.sin, 0);
}

Vec3 Route::at(double s_m, double left_m) const {
  const double s = s_m - whole_part(s_m / length_m_) * length_m_;
  const auto i = std::min(static_cast<std::size_t>(s / kStep_m), places_.size() - 1);
  const double begin_m = static_cast<double>(i) * kStep_m;
  const SinCos heading = sincos_turns(heading_turns(s));
  return step(places_[i], begin_m, s - begin_m) + left_m * Vec3(-heading.sin, heading.cos, 0);
}

double Route::distance_m(const Vec3& p, double limit_m) const {
  double nearest2 = limit_m * limit_m;
  for (const Vec3& place : places_)
    nearest2 = std::min(nearest2, (place - Vec3(p.x(), p.y(), 0)).squaredNorm());
  return std::sqrt(nearest2);
}

}  // namespace slambed::synth
