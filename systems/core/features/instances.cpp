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

/// 1 for pixels that something moving covers.
std::vector<std::uint8_t> moving_pixels(const FrameMasks& masks) {
  std::vector<std::uint8_t> pixels(static_cast<std::size_t>(masks.width) *
                                   static_cast<std::size_t>(masks.height));
  for (const Instance& instance : masks.instances) {
    if (!instance.moves) continue;
    auto at = pixels.begin();
    for (std::size_t i = 0; i < instance.runs.size(); ++i) {
      const auto end = at + instance.runs[i];
      if (i % 2 == 1) std::fill(at, end, std::uint8_t{1});
      at = end;
    }
  }
  return pixels;
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

std::vector<std::uint8_t> features_off_masks(const FeatureSet& features, const FrameMasks& masks,
                                             int border_px) {
  const Camera& camera = features.sensor().camera;
  if (masks.width != camera.width || masks.height != camera.height) {
    throw bad_input("masks are " + std::to_string(masks.width) + "x" +
                    std::to_string(masks.height) + " px, the camera has " +
                    std::to_string(camera.width) + "x" + std::to_string(camera.height) +
                    "; segment pictures of this camera");
  }
  std::vector<std::uint8_t> keep(static_cast<std::size_t>(features.size()), 1);
  const bool any = std::any_of(masks.instances.begin(), masks.instances.end(),
                               [](const Instance& instance) { return instance.moves; });
  if (!any) return keep;
  const auto moving = moving_pixels(masks);
  for (int i = 0; i < features.size(); ++i) {
    const KeyPoint& seen = features.keypoint(i);
    const Eigen::Vector2d at = camera.distort(seen.u, seen.v);
    const int x = static_cast<int>(std::lround(at.x())), y = static_cast<int>(std::lround(at.y()));
    const int left = std::max(0, x - border_px), right = std::min(masks.width - 1, x + border_px);
    const int low = std::min(masks.height - 1, y + border_px);
    for (int row = std::max(0, y - border_px); row <= low && keep[i] != 0; ++row) {
      const auto* line = moving.data() + static_cast<std::ptrdiff_t>(row) * masks.width;
      if (left <= right && std::find(line + left, line + right + 1, 1) != line + right + 1)
        keep[i] = 0;
    }
  }
  return keep;
}

}  // namespace slambed
