// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <unordered_set>
#include <vector>

#include "slam/matching.hpp"

namespace slambed::edgeslam_semantic {

/// Names what is one feature in one frame after the other.
using FeatureTrackId = std::uint64_t;

struct FeatureTrackOptions {
  float radius_px = 20;    ///< around where a feature is expected
  float ratio = 0.9f;      ///< of the best distance to the second best
  int missing_frames = 3;  ///< that a track outlives
};

/// Matches all features of each frame with those of the frames just before.
class FeatureTracks {
 public:
  explicit FeatureTracks(FeatureTrackOptions options) : options_(options) {}

  /// The next frame. Returns the track of each feature, as long as nothing else is called.
  std::span<const FeatureTrackId> track(const FeatureSet& features);
  /// Number of the newest frame, from 1.
  int frame() const { return frame_; }
  std::span<const FeatureTrackId> ids() const { return ids_; }

  /// How many of these tracks the newest frame still has.
  int shared(const std::unordered_set<FeatureTrackId>& tracks) const;

 private:
  struct Track {
    FeatureTrackId id = 0;
    Descriptor descriptor{};
    float u = 0, v = 0, du = 0, dv = 0;  ///< where it was last, and its step from frame to frame
    float angle_deg = 0;
    int octave = 0, seen = 0;  ///< frame
  };

  FeatureTrackOptions options_;
  Matcher matcher_;
  RotationCheck rotation_;
  std::vector<Track> tracks_;
  std::vector<FeatureTrackId> ids_;
  FeatureTrackId next_ = 1;
  int frame_ = 0;
};

}  // namespace slambed::edgeslam_semantic
