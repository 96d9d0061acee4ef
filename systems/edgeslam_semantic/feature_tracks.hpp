// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <unordered_set>
#include <vector>

#include "slam/matching.hpp"

namespace slambed::edgeslam_semantic {

/// Identifies one feature across consecutive frames.
using FeatureTrackId = std::uint64_t;

struct FeatureTrackOptions {
  /// Search radius around the predicted position, per second since the frame before: what moves
  /// gets farther between two frames the fewer of them a busy device tracks. 20 px at 30 frames/s.
  float radius_px_per_s = 600;
  float ratio = 0.9f;      ///< largest ratio of the best distance to the second best
  int missing_frames = 3;  ///< consecutive frames without a match that a track survives
};

/// Matches all features of each frame with those of the preceding frames.
class FeatureTracks {
 public:
  explicit FeatureTracks(FeatureTrackOptions options) : options_(options) {}

  /// Takes the next frame, later than the one before, and returns the track of each feature. The
  /// span is valid until the next call.
  std::span<const FeatureTrackId> track(const FeatureSet& features, double time_s);
  /// Number of the newest frame, from 1.
  int frame() const { return frame_; }
  std::span<const FeatureTrackId> ids() const { return ids_; }

  /// Returns how many of these tracks the newest frame has.
  int shared(const std::unordered_set<FeatureTrackId>& tracks) const;

 private:
  struct Track {
    FeatureTrackId id = 0;
    Descriptor descriptor{};
    float u = 0, v = 0, du = 0, dv = 0;  ///< last position, and motion in pixels per second
    float angle_deg = 0;
    int octave = 0, seen = 0;  ///< seen: number of the last frame with a match
    double seen_s = 0;         ///< time of that frame
  };

  FeatureTrackOptions options_;
  Matcher matcher_;
  RotationCheck rotation_;
  std::vector<Track> tracks_;
  std::vector<FeatureTrackId> ids_;
  FeatureTrackId next_ = 1;
  int frame_ = 0;
  double time_s_ = 0;  ///< of the newest frame
};

}  // namespace slambed::edgeslam_semantic
