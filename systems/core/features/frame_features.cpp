// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <string>
#include <utility>

#include "base/error.hpp"
#include "features/feature_set.hpp"
#include "features/stereo_matcher.hpp"

namespace slambed {
namespace {

std::string size_text(int width, int height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

void check_size(const char* what, int width, int height, const Camera& camera) {
  if (width != camera.width || height != camera.height)
    throw bad_input(std::string(what) + " is " + size_text(width, height) +
                    " px but the camera has " + size_text(camera.width, camera.height) +
                    "; check the camera of the sequence");
}

Eigen::Vector2d ideal_pixel(const RawKeyPoint& raw, const Camera& camera) {
  return camera.distorted() ? camera.undistort(raw.x, raw.y) : Eigen::Vector2d(raw.x, raw.y);
}

/// Returns a feature without depth.
KeyPoint feature_at(const Eigen::Vector2d& ideal, const RawKeyPoint& raw) {
  KeyPoint point;
  point.u = static_cast<float>(ideal.x());
  point.v = static_cast<float>(ideal.y());
  point.angle_deg = raw.angle_deg;
  point.octave = raw.octave;
  return point;
}

}  // namespace

std::shared_ptr<const FeatureSet> make_rgbd_features(OrbExtractor& extractor,
                                                     std::shared_ptr<const Sensor> sensor,
                                                     GrayView gray, DepthView depth,
                                                     double depth_unit_m) {
  if (!sensor) throw bad_input("rgb-d frame: no sensor given");
  const Camera& camera = sensor->camera;
  check_size("rgb-d frame: the gray image", gray.width, gray.height, camera);
  check_size("rgb-d frame: the depth image", depth.width, depth.height, camera);
  if (!(depth_unit_m > 0) || !std::isfinite(depth_unit_m))
    throw bad_input("rgb-d frame: the depth unit must be a positive number of meters");

  std::vector<RawKeyPoint> raw;
  std::vector<Descriptor> descriptors;
  extractor.extract(gray, raw, descriptors);
  std::vector<KeyPoint> keypoints;
  keypoints.reserve(raw.size());
  for (const RawKeyPoint& r : raw) {
    const Eigen::Vector2d ideal = ideal_pixel(r, camera);
    KeyPoint p = feature_at(ideal, r);
    const std::uint16_t steps =
        depth.at(static_cast<int>(r.x + 0.5f), static_cast<int>(r.y + 0.5f));
    if (steps > 0) {
      const double depth_m = steps * depth_unit_m;
      p.depth_m = static_cast<float>(depth_m);
      p.right_u = static_cast<float>(ideal.x() - camera.bf / depth_m);
    }
    keypoints.push_back(p);
  }
  return std::make_shared<const FeatureSet>(std::move(sensor), std::move(keypoints),
                                            std::move(descriptors));
}

std::shared_ptr<const FeatureSet> make_mono_features(OrbExtractor& extractor,
                                                     std::shared_ptr<const Sensor> sensor,
                                                     GrayView gray) {
  if (!sensor) throw bad_input("monocular frame: no sensor given");
  const Camera& camera = sensor->camera;
  check_size("monocular frame: the image", gray.width, gray.height, camera);
  std::vector<RawKeyPoint> raw;
  std::vector<Descriptor> descriptors;
  extractor.extract(gray, raw, descriptors);
  std::vector<KeyPoint> keypoints;
  keypoints.reserve(raw.size());
  for (const RawKeyPoint& r : raw) keypoints.push_back(feature_at(ideal_pixel(r, camera), r));
  return std::make_shared<const FeatureSet>(std::move(sensor), std::move(keypoints),
                                            std::move(descriptors));
}

std::shared_ptr<const FeatureSet> make_stereo_features(OrbExtractor& left_extractor,
                                                       OrbExtractor& right_extractor,
                                                       StereoMatcher& matcher,
                                                       std::shared_ptr<const Sensor> sensor,
                                                       GrayView left, GrayView right) {
  if (!sensor) throw bad_input("stereo frame: no sensor given");
  if (&left_extractor == &right_extractor)
    throw bad_input("stereo frame: one extractor given twice, each image needs its own");
  const Camera& camera = sensor->camera;
  check_size("stereo frame: the left image", left.width, left.height, camera);
  check_size("stereo frame: the right image", right.width, right.height, camera);

  std::vector<RawKeyPoint> raw, right_raw;
  std::vector<Descriptor> descriptors, right_descriptors;
  left_extractor.extract(left, raw, descriptors);
  right_extractor.extract(right, right_raw, right_descriptors);
  std::vector<float> disparity;
  matcher.match({raw, descriptors, left_extractor.pyramid()},
                {right_raw, right_descriptors, right_extractor.pyramid()}, disparity);

  std::vector<KeyPoint> keypoints;
  keypoints.reserve(raw.size());
  for (std::size_t i = 0; i < raw.size(); ++i) {
    KeyPoint p;
    p.u = raw[i].x;
    p.v = raw[i].y;
    p.angle_deg = raw[i].angle_deg;
    p.octave = raw[i].octave;
    if (disparity[i] > 0) {
      p.depth_m = static_cast<float>(camera.bf / disparity[i]);
      p.right_u = p.u - disparity[i];
    }
    keypoints.push_back(p);
  }
  return std::make_shared<const FeatureSet>(std::move(sensor), std::move(keypoints),
                                            std::move(descriptors));
}

}  // namespace slambed
