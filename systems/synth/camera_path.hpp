// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "geometry/se3.hpp"

namespace slambed::synth {

/// A smooth camera path: camera-to-world pose (world z up) over time, also defined outside of its
/// duration.
class CameraPath {
 public:
  virtual ~CameraPath() = default;
  virtual SE3 at(double time_s) const = 0;
  virtual double duration_s() const = 0;
};

/// Named paths:
///   still    one pose, for tests
///   spline   seeded walk around the tables with a wandering gaze
///   office   87 s around the tables, fast turn to the wall from 22 to 25 s, slowly back by 42 s
///   desk     142 s around the tables at 0.12 m/s
///   two_laps the same round twice, 48 s each
///   xyz      back and forth along the axes in front of the tables, like TUM's *_xyz
///   halfsphere on a half sphere with a radius of 0.5 m, like TUM's *_halfsphere
std::unique_ptr<CameraPath> make_path(const std::string& name, double duration_s,
                                      std::uint64_t seed);
std::vector<std::string> path_names();

/// A TUM-format trajectory file (camera to world, z up) as a smooth path. It is recentered: the
/// middle of its bounding box to x = y = 0, its mean height to `height_m`.
struct RecordedPath {
  std::unique_ptr<CameraPath> path;
  double start_s = 0;  ///< recorded time of the path's time 0
};
RecordedPath read_path(const std::filesystem::path& file, double height_m = 1.45);

/// Returns R_wc of a camera that looks along yaw (about z, from x) and pitch (up), rolled about its
/// optical axis.
Eigen::Matrix3d look(double yaw_deg, double pitch_deg, double roll_deg);

}  // namespace slambed::synth
