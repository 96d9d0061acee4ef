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

/// Where a camera is at a time: camera to world (world z up), smooth, defined outside its range
/// too.
class CameraPath {
 public:
  virtual ~CameraPath() = default;
  virtual SE3 at(double time_s) const = 0;
  virtual double duration_s() const = 0;
};

/// Named paths:
///   still    one pose, for tests
///   spline   seeded walk around the tables with a wandering gaze
///   office   87 s around the tables, fast turn to the wall and back from 22 to 25 s
///   desk     142 s around the tables at 0.12 m/s
///   two_laps the same round twice, 48 s each
///   xyz      to and fro along the axes before the tables, as TUM's *_xyz
///   halfsphere on a half sphere of half a meter, as TUM's *_halfsphere
std::unique_ptr<CameraPath> make_path(const std::string& name, double duration_s,
                                      std::uint64_t seed);
std::vector<std::string> path_names();

/// A TUM-format trajectory file (camera to world, z up) as a smooth path, recentered: the middle of
/// its bounding box to x = y = 0, its mean height to `height_m`. start_s: recorded time of time 0.
struct RecordedPath {
  std::unique_ptr<CameraPath> path;
  double start_s = 0;
};
RecordedPath read_path(const std::filesystem::path& file, double height_m = 1.45);

/// Camera looking along yaw (about z, from x) and pitch (up), turned by roll about its axis.
Eigen::Matrix3d look(double yaw_deg, double pitch_deg, double roll_deg);

}  // namespace slambed::synth
