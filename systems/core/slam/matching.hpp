// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "slam/frame.hpp"

namespace slambed {

/// Scale range tolerance and viewing-angle limit of a map point (ORB-SLAM2).
inline constexpr float kNearest = 0.8f, kFarthest = 1.2f;
inline constexpr float kMinViewCosine = 0.5f;  ///< 60 degrees

/// Where a map point should be seen in an image.
struct Projection {
  float u = 0, v = 0;
  float right_u = 0;  ///< in the virtual right image
  float distance_m = 0;
  float view_cosine = 1;  ///< between the viewing ray and the point's normal
};

/// A camera at a known pose, ready to project many points.
class Viewpoint {
 public:
  Viewpoint(const Sensor& sensor, const SE3& T_cw)
      : sensor_(sensor), T_cw_(T_cw), center_(T_cw.inverse().t) {}

  /// False when behind the camera or outside the image.
  bool project(const Eigen::Vector3d& p_w, Projection& out) const;
  /// Also false when outside the point's distance range or viewing angle.
  bool sees(const PointSketch& point, Projection& out) const;

  const SE3& T_cw() const { return T_cw_; }
  const Eigen::Vector3d& center() const { return center_; }

 private:
  const Sensor& sensor_;
  SE3 T_cw_;
  Eigen::Vector3d center_;
};

/// Keeps matches whose change of keypoint orientation agrees with the majority: of bins of 30
/// degrees the three fullest, the second and third only with a tenth of the fullest.
class RotationCheck {
 public:
  void clear();
  void add(float from_deg, float to_deg, int feature);
  /// Features of the matches that do not agree, ascending within a bin.
  std::vector<int> disagreeing() const;

 private:
  static constexpr int kBins = 12;
  std::array<std::vector<int>, kBins> bins_;
};

/// Area searches in one image. Keeps scratch memory; one instance per module.
class Matcher {
 public:
  struct Query {
    Projection at;
    float radius_px = 0;  ///< window size, also the limit of the right_u error
    int min_octave = 0, max_octave = 0;
    const Descriptor* descriptor = nullptr;
  };
  struct Best {
    int feature = -1;
    int distance = 257, second_distance = 257;
    int octave = -1, second_octave = -1;
  };

  /// The two closest descriptors among features in the window for which usable(feature) holds.
  template <typename Usable>
  Best search(const FeatureSet& features, const Query& query, Usable&& usable) {
    features.in_window(query.at.u, query.at.v, query.radius_px, query.min_octave, query.max_octave,
                       window_);
    std::size_t kept = 0;
    for (const int feature : window_) {
      if (!usable(feature)) continue;
      const float right_u = features.keypoint(feature).right_u;
      if (right_u > 0 && std::abs(query.at.right_u - right_u) > query.radius_px) continue;
      window_[kept++] = feature;
    }
    window_.resize(kept);
    return closest(features, *query.descriptor);
  }

  /// Matches points of one image with features of another by descriptor alone: distance at most
  /// kHammingLow, best / second below ratio, rotation check; a feature goes to its best point.
  /// Returns pairs (index into `points`, feature), ascending by feature.
  struct Seen {
    const Descriptor* descriptor;
    float angle_deg;
  };
  std::vector<std::pair<int, int>> match_all(std::span<const Seen> points,
                                             const FeatureSet& features, float ratio);

 private:
  Best closest(const FeatureSet& features, const Descriptor& descriptor);

  std::vector<int> window_;
  std::vector<std::uint16_t> distances_;
};

}  // namespace slambed
