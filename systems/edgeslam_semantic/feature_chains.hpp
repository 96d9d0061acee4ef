// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <unordered_set>
#include <vector>

#include "slam/matching.hpp"

namespace slambed::edgeslam_semantic {

/// Names what is one feature in one frame after the other.
using ChainId = std::uint64_t;

struct ChainOptions {
  float radius_px = 20;    ///< around where a feature is expected
  float ratio = 0.9f;      ///< of the best distance to the second best
  int missing_frames = 3;  ///< that a chain outlives
};

/// Matches all features of each frame with those of the frames just before.
class FeatureChains {
 public:
  explicit FeatureChains(ChainOptions options) : options_(options) {}

  /// The next frame. Returns the chain of each feature, as long as nothing else is called.
  std::span<const ChainId> follow(const FeatureSet& features);
  /// Number of the newest frame, from 1.
  int frame() const { return frame_; }
  std::span<const ChainId> ids() const { return ids_; }

  /// How many of these chains the newest frame still has.
  int shared(const std::unordered_set<ChainId>& chains) const;

 private:
  struct Chain {
    ChainId id = 0;
    Descriptor descriptor{};
    float u = 0, v = 0, du = 0, dv = 0;  ///< where it was last, and its step from frame to frame
    float angle_deg = 0;
    int octave = 0, seen = 0;  ///< frame
  };

  ChainOptions options_;
  Matcher matcher_;
  RotationCheck rotation_;
  std::vector<Chain> chains_;
  std::vector<ChainId> ids_;
  ChainId next_ = 1;
  int frame_ = 0;
};

}  // namespace slambed::edgeslam_semantic
