// SPDX-License-Identifier: Apache-2.0
#include "features/instances.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"

namespace slambed {
namespace {

std::string defect_of(const Instance& instance, std::uint64_t pixels) {
  if (!std::isfinite(instance.score) || instance.score < 0 || instance.score > 1)
    return "a score is not within 0 and 1";
  std::uint64_t covered = 0;
  for (std::size_t i = 0; i < instance.runs.size(); ++i) {
    if (i > 0 && instance.runs[i] == 0) return "a run of a mask is empty";
    covered += instance.runs[i];
  }
  if (covered != pixels) return "the runs of a mask do not cover the picture";
  if (!instance.body) return {};
  for (const BodyPoint& point : *instance.body) {
    if (!std::isfinite(point.u) || !std::isfinite(point.v)) return "a key point is not finite";
    if (point.visibility > BodyPoint::Visibility::kSeen)
      return "a key point's visibility is not 0, 1 or 2";
  }
  return {};
}

}  // namespace

std::string defect(const FrameMasks& masks) {
  if (masks.instances.size() > FrameMasks::kMostInstances) return "there are too many instances";
  const auto pixels =
      static_cast<std::uint64_t>(masks.width) * static_cast<std::uint64_t>(masks.height);
  for (const Instance& instance : masks.instances)
    if (auto found = defect_of(instance, pixels); !found.empty()) return found;
  return {};
}

MovingArea::MovingArea(const FrameMasks& masks) : width_(masks.width), height_(masks.height) {
  for (const Instance& instance : masks.instances) {
    if (!instance.moves) continue;
    pixels_.resize(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
    auto at = pixels_.begin();
    for (std::size_t i = 0; i < instance.runs.size(); ++i) {
      const auto end = at + instance.runs[i];
      if (i % 2 == 1) std::fill(at, end, std::uint8_t{1});
      at = end;
    }
  }
}

bool MovingArea::covers(double x, double y, int border_px) const {
  if (empty() || !std::isfinite(x) || !std::isfinite(y)) return false;
  if (std::abs(x) > 1e6 || std::abs(y) > 1e6) return false;
  const int u = static_cast<int>(std::lround(x)), v = static_cast<int>(std::lround(y));
  const int left = std::max(0, u - border_px), right = std::min(width_ - 1, u + border_px);
  const int low = std::min(height_ - 1, v + border_px);
  if (left > right) return false;
  for (int row = std::max(0, v - border_px); row <= low; ++row) {
    const auto* line = pixels_.data() + static_cast<std::ptrdiff_t>(row) * width_;
    if (std::find(line + left, line + right + 1, 1) != line + right + 1) return true;
  }
  return false;
}

void check_size(const FrameMasks& masks, const Camera& camera) {
  if (masks.width != camera.width || masks.height != camera.height) {
    throw bad_input("masks are " + std::to_string(masks.width) + "x" +
                    std::to_string(masks.height) + " px, the camera has " +
                    std::to_string(camera.width) + "x" + std::to_string(camera.height) +
                    "; segment pictures of this camera");
  }
}

std::vector<std::uint8_t> features_off_masks(const FeatureSet& features, const FrameMasks& masks,
                                             int border_px) {
  const Camera& camera = features.sensor().camera;
  check_size(masks, camera);
  std::vector<std::uint8_t> keep(static_cast<std::size_t>(features.size()), 1);
  const MovingArea moving(masks);
  if (moving.empty()) return keep;
  for (int i = 0; i < features.size(); ++i) {
    const KeyPoint& seen = features.keypoint(i);
    const Eigen::Vector2d at = camera.distort(seen.u, seen.v);
    if (moving.covers(at.x(), at.y(), border_px)) keep[i] = 0;
  }
  return keep;
}

}  // namespace slambed
