// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "geometry/sim3.hpp"
#include "map/map.hpp"
#include "slam/keyframe_copy.hpp"
#include "slam/matching.hpp"
#include "slam/place_index.hpp"

namespace slambed {

/// Two keyframes that show the same place, and their matches.
struct LoopMatch {
  KeyFrameId keyframe;             ///< the new one
  KeyFrameId matched;              ///< the old one
  Sim3 S_cw;                       ///< corrected pose of the new one, from the old part of the map
  std::vector<MapPointId> points;  ///< per feature of the new one: old point it sees, or none
  std::vector<MapPointId> loop_points;  ///< all points of the old part, ascending
  int matches = 0;                      ///< of the new keyframe with old points
};

/// ORB-SLAM2's limits.
struct LoopVerifierOptions {
  float word_ratio = 0.75f;
  int least_matches = 20;       ///< by words, and inliers of every estimate
  int least_total = 40;         ///< with the points of the old keyframe's neighbors
  float pair_radius_px = 7.5f;  ///< guided search between the two keyframes
  float points_radius_px = 10;  ///< the same for all points of the old part
};

/// Decides whether a candidate closes a loop: matches by words, estimates a similarity (Sim3) that
/// holds in both images, and searches for more matches with it.
class LoopVerifier {
 public:
  LoopVerifier(LoopVerifierOptions options, std::shared_ptr<PlaceIndex> places)
      : options_(options), places_(std::move(places)) {}

  std::optional<LoopMatch> verify(const Map& map, KeyFrameId keyframe, KeyFrameId candidate);
  /// The same for a keyframe that is not in the map; fresh holds it and all points that it sees.
  std::optional<LoopMatch> verify(const Map& map, const MapDelta& fresh, const BagOfWords& bag,
                                  KeyFrameId candidate);

 private:
  /// A keyframe and its points.
  struct Side {
    KeyFrameCopy keyframe;
    std::vector<PointSketch> points;
    std::vector<int> of_feature;  ///< index into points or -1
    std::vector<std::uint8_t> has_point;
  };
  using Pairs = std::vector<std::pair<int, int>>;  ///< feature of the new one, of the old one

  static bool copy(const MapView& view, KeyFrameId id, Side& side);
  static Side side_of(const MapDelta& fresh);
  std::optional<LoopMatch> compare(const Map& map, const BagOfWords& bag,
                                   const BagOfWords& candidate_bag);
  /// Copies the points of the old part; called only for candidates that have passed so far.
  bool copy_loop_points(const Map& map, KeyFrameId candidate);
  /// Estimates the similarity of the pairs, from scratch or from S_12; keeps only pairs that fit.
  bool estimate(Pairs& pairs, Sim3& S_12, bool from_scratch) const;
  void add_pairs(const Sim3& S_12, Pairs& pairs);
  std::vector<int> project(const Side& from, const Side& into, const Sim3& S_into_from,
                           std::span<const std::uint8_t> taken_from,
                           std::span<const std::uint8_t> taken_into);
  void add_points(LoopMatch& match);

  LoopVerifierOptions options_;
  std::shared_ptr<PlaceIndex> places_;
  Matcher matcher_;
  Side current_, matched_;
  std::vector<PointSketch> loop_points_;  ///< ascending by id
};

/// Sketches of those points that still exist, in the same order.
std::vector<PointSketch> sketch_points(const MapView& view, std::span<const MapPointId> ids);

}  // namespace slambed
