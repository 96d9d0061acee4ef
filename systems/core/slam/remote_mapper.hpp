// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

#include "slam/bundle_window.hpp"
#include "slam/loop_verifier.hpp"

namespace slambed {

struct RemoteMapperOptions {
  int place_candidates = 5;      ///< similar keyframes of earlier trips
  int near_candidates = 5;       ///< ... and those near the estimated pose
  double search_radius_m = 20;   ///< around the estimated pose
  LoopVerifierOptions verifier;  ///< ORB-SLAM2's limits of a loop, without its consistency rule
  BundleOptions bundle;
};

/// CloudSLAM's Remote Mapping: loop closing reduced to one keyframe, without pose graph or global
/// bundle. The keyframe is matched with the map of earlier trips, moved to its pose there, joined
/// with its points, and adjusted with those received before it. Earlier trips' keyframes stay
/// fixed.
///
/// Keyframes of earlier trips have ids in IdSpace::kEdgeMapper (store/archive.hpp), those of this
/// trip in another space. One call per stage, as in LocalMapper; the caller commits the deltas.
class RemoteMapper {
 public:
  struct Match {
    KeyFrameId matched;  ///< keyframe of an earlier trip that shows the place; none: no match
    int tried = 0;       ///< candidates tried
    int matches = 0;     ///< with points of the global map
    MapDelta delta;      ///< adds the keyframe to the global map; empty without a match
  };

  /// map: the global map, initially only the earlier trips. places: index of exactly these
  /// keyframes.
  RemoteMapper(RemoteMapperOptions options, std::shared_ptr<Map> map,
               std::shared_ptr<PlaceIndex> places);

  /// received: one keyframe with all points it sees, as the vehicle estimates them. estimated: its
  /// pose is good enough to search around it.
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
