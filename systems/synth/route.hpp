// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "synth/scene.hpp"

namespace slambed::synth {

/// The middle of the driven lane of a closed street, by its length along it. The heading is given
/// and the place integrated, so that curvature comes and goes smoothly. Every route is the same
/// after half a lap and half a turn, which makes it close exactly.
class Route {
 public:
  /// rectangle: 598 m, four right turns. circular: 1450 m, winding, no straight above 60 m.
  /// block: 90 m around a few houses, for tests. Throws on another name.
  explicit Route(const std::string& name);

  double length_m() const { return length_m_; }
  /// Direction in full turns from x, counted on over laps.
  double heading_turns(double s_m) const;
  /// 1/m, positive to the left.
  double curvature(double s_m) const;
  /// A place on the ground, so many meters to the left of the lane's middle.
  Vec3 at(double s_m, double left_m = 0) const;
  /// Distance on the ground from the nearest place of the whole route, as far as it is below
  /// `limit_m`.
  double distance_m(const Vec3& p, double limit_m) const;

 private:
  struct Turn {
    double begin_m, length_m, turns;
  };
  struct Wave {
    double per_lap, turns, phase;
  };

  Vec3 step(const Vec3& from, double s_m, double length_m) const;

  double length_m_ = 0;
  double constant_turns_ = 0;  ///< of heading per lap, apart from the turns
  std::vector<Turn> turns_;
  std::vector<Wave> waves_;
  std::vector<Vec3> places_;  ///< every kStep_m
};

/// Whether a trajectory of this name drives through streets.
bool is_route(const std::string& name);

}  // namespace slambed::synth
