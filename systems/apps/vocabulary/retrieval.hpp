// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <vector>

#include "features/vocabulary.hpp"
#include "geometry/se3.hpp"

namespace slambed {

struct TimedPose {
  double time_s = 0;
  SE3 T_wc;
};

/// Reads a TUM trajectory (camera to world). Throws Error(kBadInput) that names the line.
std::vector<TimedPose> read_camera_poses(const std::filesystem::path& file);
/// Returns the pose nearest in time, or nothing if it is more than 20 ms away.
std::optional<SE3> pose_at(std::span<const TimedPose> poses, double time_s);

struct RetrievalImage {
  double time_s = 0;
  SE3 T_wc;
  BagOfWords bag;
};

/// Place recognition by bags of words. Two images show the same place if their cameras are within
/// 0.5 m and 30 degrees. Images less than 5 s apart are not compared.
struct RetrievalScore {
  int queries = 0;        ///< images whose place another image shows too
  double first = 0;       ///< share of queries whose most similar image shows the same place
  double first_five = 0;  ///< share of queries where one of the five most similar images does
  double chance = 0;      ///< expected share for a random choice
};
RetrievalScore measure_retrieval(std::span<const RetrievalImage> images);

}  // namespace slambed
