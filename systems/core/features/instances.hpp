// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "features/feature_set.hpp"

namespace slambed {

/// One of COCO's 17 body keypoints of a person, in image pixels.
struct BodyPoint {
  enum class Visibility : std::uint8_t { kAbsent, kHidden, kSeen };
  float u = 0, v = 0;
  Visibility visibility = Visibility::kAbsent;
};
inline constexpr int kBodyPoints = 17;

/// One object found by instance segmentation.
struct Instance {
  std::uint16_t object_class = 0;  ///< class number of the network
  bool moves = false;              ///< the class can move: people, vehicles, animals
  float score = 0;                 ///< 0 to 1
  /// Run-length encoded mask in raster order over the whole image: pixels outside, inside, outside
  /// ... Only the first run may be empty.
  std::vector<std::uint32_t> runs;
  std::optional<std::array<BodyPoint, kBodyPoints>> body;
};

/// Segmentation result of one image.
struct FrameMasks {
  static constexpr std::size_t kMostInstances = 100;  ///< COCO's limit of detections per image
  int width = 0, height = 0;
  std::vector<Instance> instances;
};

/// Validates masks from outside the program. Returns one line about the first defect, or an empty
/// string.
std::string defect(const FrameMasks& masks);

/// The pixels of an image that moving instances cover.
class MovingArea {
 public:
  MovingArea() = default;
  explicit MovingArea(const FrameMasks& masks);
  bool empty() const { return pixels_.empty(); }
  /// Returns whether (x, y), raw pixels, is within border_px of a covered pixel along both axes.
  bool covers(double x, double y, int border_px) const;

 private:
  int width_ = 0, height_ = 0;
  std::vector<std::uint8_t> pixels_;  ///< empty when nothing moves
};

/// Throws bad_input when the masks do not have the camera's image size.
void check_size(const FrameMasks& masks, const Camera& camera);

/// Returns one flag per feature: 0 within border_px of a moving instance (MovingArea::covers), else
/// 1. Masks are in raw pixels. Throws bad_input when they do not have the camera's image size.
std::vector<std::uint8_t> features_off_masks(const FeatureSet& features, const FrameMasks& masks,
                                             int border_px);

}  // namespace slambed
