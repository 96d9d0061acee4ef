// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

#include "slam/bundle_window.hpp"
#include "slam/loop_verifier.hpp"

namespace slambed {

struct RemoteMapperOptions {
  int place_candidates = 5;      ///< prior keyframes that look alike
  int near_candidates = 5;       ///< ... and those around the estimate
  double search_radius_m = 20;   ///< how far around
  LoopVerifierOptions verifier;  ///< ORB-SLAM2's limits of a loop, without its consistency rule
  BundleOptions bundle;
};

/// CloudSLAM's Remote Mapping: loop closing cut down to one keyframe. It is looked for in the map
/// of earlier trips, put where that map says, joined with its points, and adjusted with those
/// received before it; the earlier trips' keyframes stay where they are. No pose graph, no global
/// bundle.
///
/// Keyframes of earlier trips count in IdSpace::kEdgeMapper (store/archive.hpp), those of this trip
/// elsewhere. One call per stage, as LocalMapper; the caller commits the deltas.
class RemoteMapper {
 public:
  struct Match {
    KeyFrameId matched;  ///< keyframe of an earlier trip that shows the place; none: no match
    int tried = 0;       ///< candidates looked at
    int matches = 0;     ///< with points of the global map
    MapDelta delta;      ///< takes the keyframe into the global map; empty without a match
  };

  /// map: the global map, at first nothing but the earlier trips. places knows these and no others.
  RemoteMapper(RemoteMapperOptions options, std::shared_ptr<Map> map,
               std::shared_ptr<PlaceIndex> places);

  /// received: one keyframe with all points it sees, where the vehicle believes them to be.
  /// estimated: its pose is more than a guess.
  Match match(const MapDelta& received, bool estimated);
  /// For a keyframe that was matched and committed.
  bool begin_bundle(KeyFrameId keyframe);
  bool step_bundle();
  std::size_t bundle_observations() const;
  MapDelta finish_bundle();

 private:
  std::vector<KeyFrameId> candidates(const BagOfWords& bag, const NewKeyFrame& keyframe,
                                     bool estimated) const;
  MapDelta joined(const MapDelta& received, const LoopMatch& match) const;

  RemoteMapperOptions options_;
  std::shared_ptr<Map> map_;
  std::shared_ptr<PlaceIndex> places_;
  LoopVerifier verifier_;
  BundleWindow::Scratch scratch_;
  std::optional<BundleWindow> window_;
};

}  // namespace slambed
