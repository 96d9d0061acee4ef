// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "features/feature_set.hpp"

namespace slambed {

/// One of COCO's 17 key points of a person, in pixels of the picture.
struct BodyPoint {
  enum class Visibility : std::uint8_t { kAbsent, kHidden, kSeen };
  float u = 0, v = 0;
  Visibility visibility = Visibility::kAbsent;
};
inline constexpr int kBodyPoints = 17;

/// One object that a segmentation found.
struct Instance {
  std::uint16_t object_class = 0;  ///< the network's number
  bool moves = false;              ///< of a class whose members move: people, vehicles, animals
  float score = 0;                 ///< 0 to 1
  /// The mask, row by row over the whole picture: pixels outside, inside, outside ... Only the
  /// first run may be empty.
  std::vector<std::uint32_t> runs;
  std::optional<std::array<BodyPoint, kBodyPoints>> body;
};

/// What a segmentation says of one picture.
struct FrameMasks {
  static constexpr std::size_t kMostInstances = 100;  ///< COCO's detections per picture
  int width = 0, height = 0;
  std::vector<Instance> instances;
};

/// What is wrong with masks that came from outside, in one line; empty for none.
std::string defect(const FrameMasks& masks);

/// The pixels of a picture that moving instances cover.
class MovingArea {
 public:
  MovingArea() = default;
  explicit MovingArea(const FrameMasks& masks);
  bool empty() const { return pixels_.empty(); }
  /// Whether the place (raw pixels) is covered, or nearer to one that is than the border (in either
  /// axis).
  bool covers(double x, double y, int border_px) const;

 private:
  int width_ = 0, height_ = 0;
  std::vector<std::uint8_t> pixels_;  ///< none where nothing moves
};

/// bad_input for masks of another size than the camera's pictures.
void check_size(const FrameMasks& masks, const Camera& camera);

/// Which features carry nothing that moves: 0 for those in the mask of a moving instance, or nearer
/// to one than the border (in either axis), 1 for the others. Masks lie in raw pixels. bad_input
/// for masks of another size than the camera's pictures.
std::vector<std::uint8_t> features_off_masks(const FeatureSet& features, const FrameMasks& masks,
                                             int border_px);

}  // namespace slambed
