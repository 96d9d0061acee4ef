// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>

#include "base/time.hpp"

namespace slambed::edgeslam_semantic {

/// One row of the paper's Table I: when a frame becomes a keyframe, and what is asked of extraction
/// and segmentation.
struct Configuration {
  int f_min = 20, f_max = 60;  ///< frames
  double alpha = 0.4, beta = 0.9;
  int levels = 8;    ///< n_l: octaves of the pyramid
  double n_m = 0.8;  ///< of the segmentation's non-maximum suppression
};

inline constexpr int kRows = 5;

/// Table I, rows from 1 to kRows.
const Configuration& table_row(int row);
/// The row for a network delay N. Unknown, or from 300 ms, where the table ends: the last one; 0:
/// the first.
int row_for(std::optional<Duration> delay);

/// What the keyframe decision knows of a frame (section V). Frames are those that were tracked.
struct FrameFacts {
  int frames_since_keyframe = 0;      ///< since the last one was selected
  int keyframes = 0;                  ///< selected so far in this map
  int frames_since_optimization = 0;  ///< since the local map last was optimized
  int features = 0;                   ///< of this frame
  int keyframe_features = 0;          ///< of the last keyframe ...
  int matched = 0;                    ///< ... and how many of those are found in this frame
};

enum class Selection {
  kNo,
  kByRule,  ///< the paper's four conditions
  kForced,  ///< twice f_max frames passed without any optimization, as where a result was lost
};

/// The paper's isKeyFrame.
Selection select_keyframe(const Configuration& row, const FrameFacts& frame);

}  // namespace slambed::edgeslam_semantic
