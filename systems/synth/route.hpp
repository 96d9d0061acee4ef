// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "synth/scene.hpp"

namespace slambed::synth {

/// The middle of the driven lane of a closed street, parametrized by arc length. Positions are
/// integrated from a given heading, so that curvature changes smoothly. Every route repeats after
/// half a lap, rotated by half a turn, so it closes exactly.
class Route {
 public:
  /// rectangle: 598 m, four right turns. circular: 1450 m, winding, no straight above 60 m.
  /// block: 90 m around a few houses, for tests. Throws bad_input for other names.
  explicit Route(const std::string& name);

  double length_m() const { return length_m_; }
  /// Heading in full turns from the x axis; it accumulates over laps.
  double heading_turns(double s_m) const;
  /// 1/m, positive to the left.
  double curvature(double s_m) const;
  /// Returns a place on the ground, `left_m` to the left of the lane's middle.
  Vec3 at(double s_m, double left_m = 0) const;
  /// Returns the distance on the ground to the nearest place of the route, at most `limit_m`.
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
  double constant_turns_ = 0;  ///< constant part of the heading's change per lap
  std::vector<Turn> turns_;
  std::vector<Wave> waves_;
  std::vector<Vec3> places_;  ///< every kStep_m
};

/// Whether a trajectory of this name drives through streets.
bool is_route(const std::string& name);

}  // namespace slambed::synth
