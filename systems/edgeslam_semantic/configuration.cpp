// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/configuration.hpp"

#include <algorithm>

namespace slambed::edgeslam_semantic {
namespace {

constexpr std::array<Configuration, kRows> kTable{{
    {.f_min = 10, .f_max = 40, .alpha = 0.3, .beta = 0.9, .levels = 8, .n_m = 0.8},
    {.f_min = 20, .f_max = 50, .alpha = 0.3, .beta = 0.9, .levels = 6, .n_m = 0.8},
    {.f_min = 20, .f_max = 60, .alpha = 0.4, .beta = 0.9, .levels = 6, .n_m = 0.8},
    {.f_min = 30, .f_max = 70, .alpha = 0.5, .beta = 0.8, .levels = 4, .n_m = 0.7},
    {.f_min = 40, .f_max = 80, .alpha = 0.5, .beta = 0.7, .levels = 4, .n_m = 0.6},
}};
/// Largest N of rows 1 to 4, ms.
constexpr std::array<int, kRows - 1> kUpTo_ms{10, 15, 35, 50};
/// Condition 2 blocks keyframes when a result is lost, so one is forced after this multiple of
/// f_max frames.
constexpr int kForcedAfter = 2;

}  // namespace

const Configuration& table_row(int row) {
  return kTable[static_cast<std::size_t>(std::clamp(row, 1, kRows) - 1)];
}

int row_for(std::optional<Duration> delay) {
  if (!delay) return kDefaultRow;
  const auto within = [&](int up_to_ms) { return *delay <= std::chrono::milliseconds(up_to_ms); };
  const auto found = std::find_if(kUpTo_ms.begin(), kUpTo_ms.end(), within);
  return static_cast<int>(found - kUpTo_ms.begin()) + 1;
}

Selection select_keyframe(const Configuration& row, const FrameFacts& frame) {
  if (frame.frames_since_optimization >= kForcedAfter * row.f_max &&
      frame.frames_since_keyframe >= kForcedAfter * row.f_max)
    return Selection::kForced;
  const bool due = frame.frames_since_keyframe > row.f_min || frame.keyframes < row.f_min;
  const bool fresh = frame.frames_since_optimization < row.f_max;
  const double before = frame.keyframe_features;
  const bool rich = frame.features >= row.alpha * before;
  const bool different = frame.matched <= row.beta * before;
  return due && fresh && rich && different ? Selection::kByRule : Selection::kNo;
}

}  // namespace slambed::edgeslam_semantic
