// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "map/map.hpp"
#include "slam/frame_search.hpp"
#include "slam/place_index.hpp"

namespace slambed {

/// Relocalizes a lost frame: finds similar keyframes, matches inside the vocabulary's nodes, solves
/// P3P in RANSAC, and searches for more matches in narrower windows until enough agree.
class Relocalizer {
 public:
  /// Keyframes tried per frame.
  static constexpr std::size_t kCandidates = 8;

  /// Without an index, makes its own with the built-in vocabulary on first use.
  explicit Relocalizer(std::shared_ptr<PlaceIndex> places = nullptr) : places_(std::move(places)) {}

  /// True when the frame has a verified pose and matches; around: the last reference keyframe.
  bool locate(const Map& map, KeyFrameId around, FrameSearch& search, Frame& frame);
  /// For the last locate(): keyframes whose matches gave a pose, correct or not.
  int candidates_posed() const { return candidates_posed_; }
  /// Matches a keyframe's points by descriptor inside the vocabulary's nodes. Replaces all matches;
  /// returns their number.
  int match(const Map& map, KeyFrameId keyframe, float ratio, Frame& frame);

 private:
  PlaceIndex& places();
  std::vector<KeyFrameId> candidates(const Map& map, KeyFrameId around,
                                     const BagOfWords& bag) const;
  bool copy(const Map& map, KeyFrameId candidate);
  bool try_keyframe(const BagOfWords& bag, const BagOfWords& candidate_bag, FrameSearch& search,
                    Frame& frame);
  bool start_pose(std::span<const std::pair<int, int>> matches, Frame& frame) const;

  std::shared_ptr<PlaceIndex> places_;
  int candidates_posed_ = 0;
  // The keyframe being tried.
  std::shared_ptr<const FeatureSet> features_;
  std::vector<SeenPoint> points_;
  std::vector<int> point_of_feature_;  ///< index into points_ or -1
  std::vector<std::uint8_t> has_point_;
};

}  // namespace slambed
