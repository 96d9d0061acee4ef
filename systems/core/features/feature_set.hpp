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

/// The kind of camera that recorded a sequence.
enum class SensorKind : std::uint8_t { kRgbd, kStereo, kMono };

/// Returns the number of images per frame that features are extracted from.
constexpr int images_per_frame(SensorKind kind) { return kind == SensorKind::kStereo ? 2 : 1; }

/// Calibration shared by all frames of one sequence.
struct Sensor {
  Camera camera;
  ImageBounds bounds;
  ScalePyramid pyramid;
  float close_depth_m = 0;  ///< bf * ThDepth / fx; nearer points are "close"

  /// Returns whether depth is measured, so that the map has metric scale.
  bool metric() const { return camera.bf > 0; }
};

/// Immutable features of one image with a 64x48 grid for window search. Frames, keyframes and
/// messages share it.
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

  /// Replaces out by the indices of keypoints with |du| < radius, |dv| < radius and octave in
  /// [min_octave, max_octave], in ascending cell order.
  void in_window(float u, float v, float radius_px, int min_octave, int max_octave,
                 std::vector<int>& out) const;

 private:
  std::shared_ptr<const Sensor> sensor_;
  std::vector<KeyPoint> keypoints_;
  std::vector<Descriptor> descriptors_;
  std::vector<std::uint16_t> cell_items_;
  std::vector<std::uint16_t> cell_begin_;  ///< 64*48 + 1 offsets into cell_items_
};

/// Returns the features whose keep flag is not 0, in order. Throws bad_input unless keep has one
/// flag per feature. Used by policies that drop moving objects or whole pyramid levels.
std::shared_ptr<const FeatureSet> select(const FeatureSet& features,
                                         std::span<const std::uint8_t> keep);

/// Extracts and undistorts the features of an RGB-D frame and looks up their depth at the nearest
/// raw pixel (for level 0 the pixel that ORB-SLAM2 reads). depth_unit_m: meters per raw step.
/// right_u = u - bf / depth. Throws Error when an image does not fit the camera.
std::shared_ptr<const FeatureSet> make_rgbd_features(OrbExtractor& extractor,
                                                     std::shared_ptr<const Sensor> sensor,
                                                     GrayView gray, DepthView depth,
                                                     double depth_unit_m);

/// Extracts and undistorts the features; none has depth. Throws like make_rgbd_features.
std::shared_ptr<const FeatureSet> make_mono_features(OrbExtractor& extractor,
                                                     std::shared_ptr<const Sensor> sensor,
                                                     GrayView gray);

}  // namespace slambed
