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

/// Reads a TUM trajectory (camera to world). Throws Error(kBadInput) naming the line.
std::vector<TimedPose> read_camera_poses(const std::filesystem::path& file);
/// The pose nearest in time, at most 20 ms away.
std::optional<SE3> pose_at(std::span<const TimedPose> poses, double time_s);

struct RetrievalImage {
  double time_s = 0;
  SE3 T_wc;
  BagOfWords bag;
};

/// How well bags of words find places again. Two images show the same place when their cameras are
/// within 0.5 m and 30 degrees; images less than 5 s apart are not compared.
struct RetrievalScore {
  int queries = 0;        ///< images whose place is shown by an image of another time
  double first = 0;       ///< share of them whose most similar image shows it
  double first_five = 0;  ///< ... one of the five most similar
  double chance = 0;      ///< share expected of a random choice
};
RetrievalScore measure_retrieval(std::span<const RetrievalImage> images);

}  // namespace slambed
