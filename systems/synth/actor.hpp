// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "synth/skeleton.hpp"

namespace slambed::synth {

/// State of a walking figure at one moment.
struct Step {
  Vec3 place = Vec3::Zero(), ahead = Vec3::UnitX();
  double walked_m = 0;
  double pace = 0;  ///< share of the usual speed; 0: standing
};

/// A smooth closed walk on the floor. A function of place and time may slow it down.
class Track {
 public:
  using Pace = std::function<double(const Vec3& place, double time_s)>;

  /// control: at least 4 control points of a uniform cubic B-spline. start: position at time 0, as
  /// a share of the round.
  Track(std::span<const Vec3> control, double speed_m_s, double start, double duration_s,
        const Pace& pace);
  Step at(double time_s) const;

 private:
  std::vector<Step> steps_;  ///< every kStep_s, from one second before time 0
};

/// A person who walks along a track, or stands or sits at one place. Arms, head and back move with
/// the gait and with gestures that depend on the seed.
class Actor {
 public:
  static Actor walking(Build build, Track track, std::uint64_t seed);
  static Actor standing(Build build, const Vec3& place, double yaw_deg, std::uint64_t seed);
  static Actor sitting(Build build, const Vec3& place, double yaw_deg, std::uint64_t seed);

  const Build& build() const { return build_; }
  Stance stance(double time_s) const;
  PartPoses parts(double time_s) const { return place_parts(build_, stance(time_s)); }
  bool sits() const { return sits_; }
  /// Height of the seat of a sitting person.
  double seat_m() const { return build_.shin_m() + build_.ankle_m() - 0.045 * build_.height_m; }

 private:
  Actor(Build build, std::uint64_t seed);
  /// Returns a slow oscillation between about -1 and 1; every `number` has its own.
  double gesture(int number, double time_s) const;
  void walk(const Step& step, Stance& stance) const;
  void gesticulate(double share, double time_s, Stance& stance) const;

  Build build_;
  std::vector<Track> track_;  ///< at most one
  Step rest_;                 ///< used without a track
  bool sits_ = false;
  std::vector<double> phases_, hertz_;
};

}  // namespace slambed::synth
