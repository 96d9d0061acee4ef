// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>

#include "base/time.hpp"

namespace slambed::edgeslam_semantic {

/// One row of the paper's Table I: thresholds of the keyframe decision (f_min, f_max, alpha, beta)
/// and settings of extraction and segmentation.
struct Configuration {
  int f_min = 20, f_max = 60;  ///< frames
  double alpha = 0.4, beta = 0.9;
  int levels = 8;    ///< n_l: octaves of the pyramid
  double n_m = 0.8;  ///< threshold of the segmentation's non-maximum suppression
};

inline constexpr int kRows = 5;
/// Row of the paper's defaults, which hold until the link has been measured.
inline constexpr int kDefaultRow = 3;

/// Returns a row of Table I; rows are numbered from 1 to kRows.
const Configuration& table_row(int row);
/// Returns the row for a network delay N: that of the defaults if N is unknown, and the last one
/// beyond 300 ms, where the table ends.
int row_for(std::optional<Duration> delay);

/// The input of the keyframe decision (section V). Only tracked frames are counted.
struct FrameFacts {
  int frames_since_keyframe = 0;      ///< since the last one was selected
  int keyframes = 0;                  ///< selected so far in this map
  int frames_since_optimization = 0;  ///< since the local map was last optimized
  int features = 0;                   ///< of this frame
  int keyframe_features = 0;          ///< of the last keyframe
  int matched = 0;                    ///< features of the last keyframe that this frame still has
};

enum class Selection {
  kNo,
  kByRule,  ///< the paper's four conditions
  kForced,  ///< 2 f_max frames passed without an optimization, e.g. because a result was lost
};

/// The paper's isKeyFrame.
Selection select_keyframe(const Configuration& row, const FrameFacts& frame);

}  // namespace slambed::edgeslam_semantic
