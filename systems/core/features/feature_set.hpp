// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "features/image.hpp"
#include "features/keypoint.hpp"
#include "features/orb_extractor.hpp"
#include "geometry/camera.hpp"

namespace slambed {

/// What a sequence brings besides a gray image.
enum class SensorKind : std::uint8_t { kRgbd, kStereo, kMono };

/// Images that features are extracted from per frame.
constexpr int images_per_frame(SensorKind kind) { return kind == SensorKind::kStereo ? 2 : 1; }

/// What all frames of one sequence share.
struct Sensor {
  Camera camera;
  ImageBounds bounds;
  ScalePyramid pyramid;
  float close_depth_m = 0;  ///< bf * ThDepth / fx: nearer points are "close"

  /// Depth is measured, so the map has a scale; a single camera knows none.
  bool metric() const { return camera.bf > 0; }
};

/// Immutable features of one image with a 64x48 grid for area search. Shared by frame, keyframe and
/// messages; what a keyframe sends is exactly this.
class FeatureSet {
 public:
  FeatureSet(std::shared_ptr<const Sensor> sensor, std::vector<KeyPoint> keypoints,
             std::vector<Descriptor> descriptors);

  int size() const { return static_cast<int>(keypoints_.size()); }
  const Sensor& sensor() const { return *sensor_; }
  std::shared_ptr<const Sensor> sensor_ptr() const { return sensor_; }
  std::span<const KeyPoint> keypoints() const { return keypoints_; }
  std::span<const Descriptor> descriptors() const { return descriptors_; }
  const KeyPoint& keypoint(int i) const { return keypoints_[i]; }
  const Descriptor& descriptor(int i) const { return descriptors_[i]; }
  float inv_sigma2(int i) const { return sensor_->pyramid.inv_sigma2[keypoints_[i].octave]; }

  /// Appends the indices of keypoints with |du| < radius, |dv| < radius and octave in
  /// [min_octave, max_octave] to out (cleared first), in ascending cell order.
  void in_window(float u, float v, float radius_px, int min_octave, int max_octave,
                 std::vector<int>& out) const;

 private:
  std::shared_ptr<const Sensor> sensor_;
  std::vector<KeyPoint> keypoints_;
  std::vector<Descriptor> descriptors_;
  std::vector<std::uint16_t> cell_items_;
  std::vector<std::uint16_t> cell_begin_;  ///< 64*48 + 1 offsets into cell_items_
};

/// The features for which keep is not 0, in their order; keep has one number per feature (bad_input
/// otherwise). For policies that leave out moving things or whole pyramid levels.
std::shared_ptr<const FeatureSet> select(const FeatureSet& features,
                                         std::span<const std::uint8_t> keep);

/// Extraction, undistortion and depth lookup for an RGB-D frame. depth_unit_m: meters per raw step.
/// Depth is read at the nearest raw pixel (the pixel ORB-SLAM2 reads on level 0, where it truncates
/// whole numbers); right_u = u - bf / depth. Throws Error when an image does not fit the camera.
std::shared_ptr<const FeatureSet> make_rgbd_features(OrbExtractor& extractor,
                                                     std::shared_ptr<const Sensor> sensor,
                                                     GrayView gray, DepthView depth,
                                                     double depth_unit_m);

/// Extraction and undistortion only: no feature has depth. Throws as make_rgbd_features.
std::shared_ptr<const FeatureSet> make_mono_features(OrbExtractor& extractor,
                                                     std::shared_ptr<const Sensor> sensor,
                                                     GrayView gray);

}  // namespace slambed
