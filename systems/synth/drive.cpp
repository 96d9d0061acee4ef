// SPDX-License-Identifier: Apache-2.0
#include "synth/drive.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "synth/random.hpp"

namespace slambed::synth {
namespace {

constexpr double kGrid_m = 0.1;
constexpr double kRunUp_m = 32;  ///< from the beginning of lap 1 to the start line
constexpr double kSpeedUp_m_s2 = 1.4, kBrake_m_s2 = 1.8;
constexpr double kCrawl_m_s = 1.8;  ///< least speed in turns
constexpr double kCameraHeight_m = 1.45, kCameraPitch_deg = -2;
constexpr double kDegPerRad = 57.29577951308232;

/// Published data of lap 2 (CloudSLAM, Table II), frames at 15 per second; `block` is ours.
struct Published {
  double top_m_s, first_top_m_s;
  int frames;
  double stop_m, stop_s;  ///< place and duration of the stop in lap 2; 0: no stop
};

Published published(const std::string& name) {
  if (name == "rectangle") return {6.7056, 7.2, 1922, 402, 4};  // 15 mph
  if (name == "circular") return {10.729, 9.8, 2984, 910, 5};   // 24 mph
  return {4.5, 4.8, 390, 0, 0};
}

double sine(double cycles) { return sincos_turns(cycles).sin; }

}  // namespace

std::size_t Drive::grid(double s_m) const {
  return static_cast<std::size_t>((s_m + kRunUp_m) / kGrid_m + 0.5);
}

/// Returns the largest speed at each grid point that turns, engine and brakes allow.
std::vector<double> Drive::speeds(const Limits& first, const Limits& second) const {
  const std::size_t border = grid(route_.length_m()), count = grid(2 * route_.length_m()) + 1;
  std::vector<double> v(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Limits& limits = i < border ? first : second;
    const double bend = std::abs(route_.curvature(static_cast<double>(i) * kGrid_m - kRunUp_m));
    const double turning = bend > 1e-6 ? std::sqrt(limits.sideways_m_s2 / bend) : limits.top_m_s;
    v[i] = std::clamp(turning, kCrawl_m_s, limits.top_m_s);
  }
  v[0] = 0;
  if (stop_ > 0) v[stop_] = 0;
  for (std::size_t i = 1; i < count; ++i)
    v[i] = std::min(v[i], std::sqrt(v[i - 1] * v[i - 1] + 2 * kSpeedUp_m_s2 * kGrid_m));
  for (std::size_t i = count - 1; i-- > 0;)
    v[i] = std::min(v[i], std::sqrt(v[i + 1] * v[i + 1] + 2 * kBrake_m_s2 * kGrid_m));
  return v;
}

double Drive::lap_s(const std::vector<double>& v, std::size_t begin, std::size_t end) const {
  double sum = 0;
  for (std::size_t i = begin; i < end; ++i) sum += 2 * kGrid_m / (v[i] + v[i + 1]);
  return sum;
}

Drive::Drive(const std::string& name, std::uint64_t seed) : route_(name) {
  bumps_ = Random(seed, 0x20000).uniform();
  const Published wanted = published(name);
  const std::size_t border = grid(route_.length_m()), end = grid(2 * route_.length_m());
  if (wanted.stop_m > 0) stop_ = grid(route_.length_m() + wanted.stop_m);
  stop_s_ = wanted.stop_s;
  // From the first frame of lap 2 to its last one.
  const double lap_s2 = (wanted.frames - 1) / 15.0;
  const Limits first{wanted.first_top_m_s, 0.9};
  Limits second{wanted.top_m_s, 0};
  double slow = 0.05, fast = 8;  // bisect the lateral acceleration for the published lap time
  for (int i = 0; i < 60; ++i) {
    second.sideways_m_s2 = 0.5 * (slow + fast);
    const bool late = lap_s(speeds(first, second), border, end) + stop_s_ > lap_s2;
    (late ? slow : fast) = second.sideways_m_s2;
  }
  const std::vector<double> v = speeds(first, second);
  const double rest_s = lap_s2 - lap_s(v, border, end) - stop_s_;
  if (std::abs(rest_s) > 0.01) throw bad_input("route '" + name + "': lap 2 cannot take its time");
  stop_s_ += stop_ > 0 ? rest_s : 0;
  const double first_s = lap_s(v, 0, border);
  second_lap_s_ = std::ceil(first_s + 1);
  stand_s_ = second_lap_s_ - first_s;
  duration_s_ = second_lap_s_ + wanted.frames / 15.0;
  put_times(v);
}

void Drive::put_times(const std::vector<double>& v) {
  samples_.resize(v.size());
  double time = stand_s_;
  for (std::size_t i = 0; i < v.size(); ++i) {
    samples_[i] = {time, v[i]};
    if (i + 1 < v.size()) time += 2 * kGrid_m / (v[i] + v[i + 1]);
    if (i == stop_ && stop_ > 0) time += stop_s_;
  }
}

double Drive::traveled_m(double t) const {
  const Sample& last = samples_.back();
  const double end_m = static_cast<double>(samples_.size() - 1) * kGrid_m - kRunUp_m;
  if (t <= samples_.front().time_s) return -kRunUp_m;
  if (t >= last.time_s) return end_m + (t - last.time_s) * last.speed_m_s;
  const auto after = std::upper_bound(samples_.begin(), samples_.end(), t,
                                      [](double x, const Sample& s) { return x < s.time_s; });
  const Sample &b = *after, &a = *(after - 1);
  const auto i = static_cast<std::size_t>(after - samples_.begin()) - 1;
  const double moving_s = 2 * kGrid_m / (a.speed_m_s + b.speed_m_s);
  const double since = std::max(0.0, t - (b.time_s - moving_s));  // a stop comes before the motion
  const double rate = (b.speed_m_s - a.speed_m_s) / moving_s;
  return static_cast<double>(i) * kGrid_m - kRunUp_m + since * (a.speed_m_s + 0.5 * rate * since);
}

double Drive::speed_m_s(double t) const {
  constexpr double kHalf_s = 0.02;
  return (traveled_m(t + kHalf_s) - traveled_m(t - kHalf_s)) / (2 * kHalf_s);
}

double Drive::leaves_behind_s(double s_m) const {
  const std::size_t i = std::min(grid(s_m), samples_.size() - 1);
  return samples_[i].time_s;
}

/// Offset to the left of the lane's middle. Odd numbers of waves cancel over the two halves of a
/// lap, so its length stays the same. Both laps are in the middle at the start line.
double Drive::beside_m(double s_m) const {
  const double laps = s_m / route_.length_m();
  const double both = 0.08 * sine(5 * laps);
  return s_m < route_.length_m() ? both : both + 0.32 * sine(3 * laps);
}

SE3 Drive::at(double t) const {
  const double s = traveled_m(t);
  constexpr double kPitchWindow_s = 0.4;
  const double ahead = speed_m_s(t + kPitchWindow_s), behind = speed_m_s(t - kPitchWindow_s);
  const double speed = speed_m_s(t), gain = (ahead - behind) / (2 * kPitchWindow_s);
  constexpr double kSlope_m = 0.2;
  const double drift = (beside_m(s + kSlope_m) - beside_m(s - kSlope_m)) / (2 * kSlope_m);
  // Bumps belong to places, not to times: both laps feel the same ones, shifted because their wheel
  // tracks differ.
  const double track = bumps_ + (s < route_.length_m() ? 0 : 0.17);
  const double bump = 0.012 * sine(s / 7.3 + track) + 0.006 * sine(s / 2.9 + 2 * track);
  const double nod_deg = 0.12 * sine(s / 5.1 + track) + 0.05 * sine(s / 1.7 + track);
  const double sway_deg = 0.15 * sine(s / 9.7 + track);
  const double yaw_deg = 360 * route_.heading_turns(s) + kDegPerRad * drift;
  const double pitch_deg = kCameraPitch_deg + 0.5 * gain + nod_deg;
  const double roll_deg = sway_deg + 0.5 * route_.curvature(s) * speed * speed;
  Vec3 p = route_.at(s, beside_m(s));
  p.z() = kCameraHeight_m + bump;
  return {look(yaw_deg, pitch_deg, roll_deg), p};
}

}  // namespace slambed::synth
