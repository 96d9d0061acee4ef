// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>

namespace slambed::synth {

// Where the robot goes. The islands of the hall stand from the west over the north to the east, and
// nothing stands in the south. A loss begins with a turn past the south and lasts because the robot
// goes on where nobody has mapped; it ends where the robot comes back to a view that it had before.

enum class Way { kShort, kLeft, kRight };

/// Turn in place to a heading or towards a place, this way round; drive there; or stand.
struct Order {
  enum class Kind { kFace, kDriveTo, kStand } kind;
  double a = 0, b = 0;  ///< heading [deg]; x, y [m]; time [s]
  Way way = Way::kShort;
  double turn_deg_s = 36, drive_m_s = 0.32;
};

constexpr Order face(double heading_deg, Way way, double deg_s = 42) {
  return {Order::Kind::kFace, heading_deg, 0, way, deg_s};
}
constexpr Order drive(double x, double y, Way way = Way::kShort, double deg_s = 36,
                      double m_s = 0.32) {
  return {Order::Kind::kDriveTo, x, y, way, deg_s, m_s};
}
constexpr Order stand(double seconds) { return {Order::Kind::kStand, seconds}; }

struct Plan {
  const char* name;
  double x, y, heading_deg, seconds;
  std::span<const Order> orders;
};

inline constexpr double kFast_deg_s = 48, kFast_m_s = 0.4;
constexpr Order dash(double x, double y, Way way) {
  return drive(x, y, way, kFast_deg_s, kFast_m_s);
}

inline constexpr std::array kPioneer2 = {
    // In the north-west, north and north-east: mapped.
    drive(-1.4, -0.2), drive(-1.0, 1.0), drive(0.8, 1.7),
    // Lost past the bare south; found in the north-west, on into the west.
    dash(0.6, -3.0, Way::kRight), dash(-0.6, -1.4, Way::kRight), drive(-1.4, -0.2),
    drive(-2.0, -0.35, Way::kLeft),
    // Lost and found where it had been last.
    face(-70, Way::kLeft, 48), stand(0.5), face(190, Way::kRight, 48),
    // Lost past the south; found in the north.
    dash(-1.2, -3.4, Way::kLeft), dash(-1.4, -0.2, Way::kLeft), drive(-1.0, 1.0),
    // Lost past the south; a glance at the north-west, and away again.
    dash(0.6, -3.0, Way::kRight), face(125, Way::kRight, 48), stand(1), face(-110, Way::kLeft, 48),
    stand(60)};

inline constexpr std::array kPioneer3 = {
    drive(-2.6, -0.45), drive(-2.9, 0.4), drive(-1.6, 1.6), drive(0.4, 2.0), drive(2.2, 1.1),
    // Past the bare south to the west, where it began.
    dash(1.2, -1.2, Way::kRight), dash(-1.4, -0.2, Way::kRight), drive(-2.6, -0.45),
    drive(-2.9, 0.4), drive(-1.6, 1.6), drive(0.4, 2.0),
    // Lost and found where it had been last.
    face(-105, Way::kRight), stand(1), face(-26, Way::kLeft), drive(2.2, 1.1),
    // Past the south once more.
    dash(-1.4, -0.2, Way::kRight), drive(-2.6, -0.45), stand(60)};

inline constexpr double kRound_deg_s = 30;
constexpr Order round_to(double heading_deg) {
  return face(heading_deg, Way::kRight, kRound_deg_s);
}
inline constexpr std::array kPioneer360 = {
    stand(1), round_to(60), round_to(-60), round_to(170), round_to(60),
    // Back before anything else was seen.
    round_to(-60), stand(1), face(60, Way::kLeft, kRound_deg_s), stand(1), round_to(-60),
    round_to(170), round_to(60), round_to(-60), round_to(170), round_to(60), round_to(-60),
    round_to(170), round_to(60), round_to(-60), stand(60)};

inline constexpr std::array kPlans = {Plan{"pioneer2", -0.6, -1.4, 125, 115.6, kPioneer2},
                                      Plan{"pioneer3", -1.4, -0.2, 192, 111.9, kPioneer3},
                                      Plan{"pioneer360", -2.6, 0.4, 150, 73, kPioneer360}};

}  // namespace slambed::synth
