// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>

namespace slambed::synth {

// Plans of the robot paths. The islands of the hall stand in the west, north and east; the south is
// empty. Tracking is lost in a turn past the south and stays lost because the robot drives on
// through unmapped places. It relocalizes when the robot returns to an earlier view.

enum class Way { kShort, kLeft, kRight };

/// One order: turn in place to a heading, turn towards a place and drive there, or stand.
struct Order {
  enum class Kind { kFace, kDriveTo, kStand };
  Kind kind = Kind::kStand;
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
    // Maps the north-west, north and north-east.
    drive(-1.4, -0.2), drive(-1.0, 1.0), drive(0.8, 1.7),
    // Lost past the bare south; relocalized in the north-west, then on to the west.
    dash(0.6, -3.0, Way::kRight), dash(-0.6, -1.4, Way::kRight), drive(-1.4, -0.2),
    drive(-2.0, -0.35, Way::kLeft),
    // Lost, then relocalized at its last place.
    face(-70, Way::kLeft, 48), stand(0.5), face(190, Way::kRight, 48),
    // Lost past the south; relocalized in the north.
    dash(-1.2, -3.4, Way::kLeft), dash(-1.4, -0.2, Way::kLeft), drive(-1.0, 1.0),
    // Lost past the south; a short look at the north-west, then away again.
    dash(0.6, -3.0, Way::kRight), face(125, Way::kRight, 48), stand(1), face(-110, Way::kLeft, 48),
    stand(60)};

inline constexpr std::array kPioneer3 = {
    drive(-2.6, -0.45), drive(-2.9, 0.4), drive(-1.6, 1.6), drive(0.4, 2.0), drive(2.2, 1.1),
    // Past the bare south, back to the west where it started.
    dash(1.2, -1.2, Way::kRight), dash(-1.4, -0.2, Way::kRight), drive(-2.6, -0.45),
    drive(-2.9, 0.4), drive(-1.6, 1.6), drive(0.4, 2.0),
    // Lost, then relocalized at its last place.
    face(-105, Way::kRight), stand(1), face(-26, Way::kLeft), drive(2.2, 1.1),
    // Past the south once more.
    dash(-1.4, -0.2, Way::kRight), drive(-2.6, -0.45), stand(60)};

inline constexpr double kRound_deg_s = 30;
constexpr Order round_to(double heading_deg) {
  return face(heading_deg, Way::kRight, kRound_deg_s);
}
inline constexpr std::array kPioneer360 = {
    stand(1), round_to(60), round_to(-60), round_to(170), round_to(60),
    // Turns back before it sees anything new.
    round_to(-60), stand(1), face(60, Way::kLeft, kRound_deg_s), stand(1), round_to(-60),
    round_to(170), round_to(60), round_to(-60), round_to(170), round_to(60), round_to(-60),
    round_to(170), round_to(60), round_to(-60), stand(60)};

inline constexpr std::array kPlans = {Plan{"pioneer2", -0.6, -1.4, 125, 115.6, kPioneer2},
                                      Plan{"pioneer3", -1.4, -0.2, 192, 111.9, kPioneer3},
                                      Plan{"pioneer360", -2.6, 0.4, 150, 73, kPioneer360}};

}  // namespace slambed::synth
