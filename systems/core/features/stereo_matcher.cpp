// SPDX-License-Identifier: Apache-2.0
#include "features/stereo_matcher.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "base/error.hpp"
#include "features/descriptor_distance.hpp"
#include "features/kernels.hpp"
#include "features/pyramid.hpp"

namespace slambed {
namespace {

// ORB-SLAM2's constants.
constexpr float kRowTolerance = 2;  ///< px on the level of the right keypoint
constexpr int kHammingLimit = (kHammingHigh + kHammingLow) / 2;
constexpr float kLeastDisparity = 0.01f;   ///< px; replaces smaller disparities
constexpr float kPoorPatch = 1.5f * 1.4f;  ///< times the median difference; worse matches fail

/// Returns the pixel of a level that contains a level-0 coordinate.
int level_pixel(float value, int level_size, int full_size) {
  const float ratio = static_cast<float>(level_size) / static_cast<float>(full_size);
  return static_cast<int>(std::floor((value + 0.5f) * ratio));
}

struct Slide {
  float offset;  ///< left column minus right column, px of the level
  int difference;
};

/// Finds the best position of the left patch around right_x and refines it with a parabola.
std::optional<Slide> slide_patch(const Kernels& kernels, GrayView left, int left_x, GrayView right,
                                 int right_x, int y) {
  constexpr int kReach = kPatchRadius + kPatchSlide;
  if (left_x < kPatchRadius || left_x >= left.width - kPatchRadius || right_x < kReach ||
      right_x >= right.width - kReach || y < kPatchRadius || y >= left.height - kPatchRadius)
    return std::nullopt;
  const PatchSlide slide =
      kernels.slide_patch(&left.at(left_x, y), left.stride, &right.at(right_x, y), right.stride);
  if (slide.best == 0 || slide.best == 2 * kPatchSlide)
    return std::nullopt;  // the true minimum may be outside the range
  // The parabola uses squares, because the kink of absolute differences at their minimum pulls it
  // towards whole pixels. Patches are compared relative to their means.
  const auto squares = [&slide](int i) {
    constexpr double kPixels = (2 * kPatchRadius + 1) * (2 * kPatchRadius + 1);
    return slide.squares[i] * kPixels - static_cast<double>(slide.total[i]) * slide.total[i];
  };
  const double before = squares(0), at = squares(1), after = squares(2);
  const double curvature = before + after - 2 * at;
  if (!(curvature > 0)) return std::nullopt;
  const float top = static_cast<float>(0.5 * (before - after) / curvature);
  if (std::abs(top) > 1) return std::nullopt;
  return Slide{static_cast<float>(left_x - (right_x + slide.best - kPatchSlide)) - top,
               slide.absolute};
}

}  // namespace

StereoMatcher::StereoMatcher(std::shared_ptr<const Sensor> sensor)
    : StereoMatcher(std::move(sensor), fastest_kernels()) {}

StereoMatcher::StereoMatcher(std::shared_ptr<const Sensor> sensor, const Kernels& kernels)
    : sensor_(std::move(sensor)), kernels_(kernels) {
  if (!sensor_) throw bad_input("stereo matcher: no sensor given");
  const Camera& camera = sensor_->camera;
  if (!(camera.bf > 0)) throw bad_input("stereo matcher: the camera has no baseline, set bf");
  if (camera.distorted())
    throw bad_input("stereo matcher: the camera has distortion, give rectified images");
}

void StereoMatcher::sort_into_rows(const Side& right) {
  const int rows = sensor_->camera.height;
  const auto each_row = [&](auto&& visit) {
    for (int i = 0; i < static_cast<int>(right.keypoints.size()); ++i) {
      const RawKeyPoint& p = right.keypoints[i];
      const float reach = kRowTolerance * sensor_->pyramid.scale[p.octave];
      const int first = std::max(0, static_cast<int>(std::floor(p.y - reach)));
      const int last = std::min(rows - 1, static_cast<int>(std::ceil(p.y + reach)));
      for (int row = first; row <= last; ++row) visit(row, i);
    }
  };
  row_begin_.assign(rows + 1, 0);
  each_row([&](int row, int) { ++row_begin_[row + 1]; });
  for (int row = 0; row < rows; ++row) row_begin_[row + 1] += row_begin_[row];
  row_items_.resize(row_begin_.back());
  next_.assign(row_begin_.begin(), row_begin_.end() - 1);
  each_row([&](int row, int i) { row_items_[next_[row]++] = i; });
}

int StereoMatcher::best_descriptor(const RawKeyPoint& point, const Descriptor& descriptor,
                                   const Side& right) {
  const int row = std::clamp(static_cast<int>(point.y + 0.5f), 0, sensor_->camera.height - 1);
  // Points are at least one baseline away, where the disparity is fx. Distant points scatter around
  // a disparity of 0.
  const float least_x = point.x - static_cast<float>(sensor_->camera.fx);
  const float most_x = point.x + sensor_->pyramid.scale[point.octave];
  candidates_.clear();
  for (int k = row_begin_[row]; k < row_begin_[row + 1]; ++k) {
    const RawKeyPoint& candidate = right.keypoints[row_items_[k]];
    if (std::abs(candidate.octave - point.octave) > 1) continue;
    if (candidate.x < least_x || candidate.x > most_x) continue;
    candidates_.push_back(row_items_[k]);
  }
  distances_.resize(candidates_.size());
  descriptor_distance().to_some(descriptor, right.descriptors.data(), candidates_,
                                distances_.data());
  int best = -1, least = kHammingLimit;
  for (std::size_t i = 0; i < candidates_.size(); ++i)
    if (distances_[i] < least) least = distances_[i], best = candidates_[i];
  return best;
}

void StereoMatcher::match(const Side& left, const Side& right, std::vector<float>& disparity) {
  disparity.assign(left.keypoints.size(), -1.0f);
  matches_.clear();
  const int levels = sensor_->pyramid.levels();
  for (const Side* side : {&left, &right})
    for (const RawKeyPoint& p : side->keypoints)
      if (p.octave >= levels || p.octave >= side->pyramid.levels())
        throw bad_input("stereo matcher: a keypoint is on octave " + std::to_string(p.octave) +
                        ", which the sensor or the image does not have");
  sort_into_rows(right);
  const Camera& camera = sensor_->camera;
  for (int i = 0; i < static_cast<int>(left.keypoints.size()); ++i) {
    const RawKeyPoint& point = left.keypoints[i];
    const int partner = best_descriptor(point, left.descriptors[i], right);
    if (partner < 0 || point.octave >= right.pyramid.levels()) continue;
    const GrayView left_level = left.pyramid.level(point.octave);
    const GrayView right_level = right.pyramid.level(point.octave);
    const auto column = [&](float x) { return level_pixel(x, left_level.width, camera.width); };
    const auto slide = slide_patch(kernels_, left_level, column(point.x), right_level,
                                   column(right.keypoints[partner].x),
                                   level_pixel(point.y, left_level.height, camera.height));
    if (!slide) continue;
    const float ratio = static_cast<float>(camera.width) / static_cast<float>(left_level.width);
    const float found = slide->offset * ratio;
    if (found < 0 || found >= static_cast<float>(camera.fx)) continue;
    disparity[i] = std::max(found, kLeastDisparity);
    matches_.push_back({i, slide->difference});
  }
  drop_poor_matches(disparity);
}

void StereoMatcher::drop_poor_matches(std::vector<float>& disparity) {
  if (matches_.empty()) return;
  const auto middle = matches_.begin() + static_cast<std::ptrdiff_t>(matches_.size() / 2);
  std::nth_element(matches_.begin(), middle, matches_.end(),
                   [](const Match& a, const Match& b) { return a.difference < b.difference; });
  const float limit = kPoorPatch * static_cast<float>(middle->difference);
  for (const Match& m : matches_)
    if (static_cast<float>(m.difference) > limit) disparity[m.left] = -1;
}

}  // namespace slambed
