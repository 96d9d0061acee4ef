// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <set>

#include "edgeslam_semantic/labels.hpp"
#include "edgeslam_semantic/local_map.hpp"
#include "edgeslam_semantic/messages.hpp"
#include "node/mobile_node.hpp"
#include "slam/local_mapper.hpp"

namespace slambed::edgeslam_semantic {

/// The mobile's local map: the content of slices plus what the mobile has triangulated since,
/// without bundle adjustment. All calls are on the tracking worker, before or after a frame.
class MobileMap {
 public:
  struct Options {
    int neighbors;  ///< keyframes with which a new one is triangulated
    int keyframes;  ///< uploaded keyframes that keep_newest() keeps
  };
  MobileMap(MobileNode& node, Options options);

  /// Inserts a new keyframe and triangulates its points.
  void extend(Worker& worker, const MapDelta& made);
  /// Returns the upload of the newest keyframe of `made`. The first upload of a map is all of
  /// `made`; later ones have the points that are new to the edge, with their earlier observations.
  SemanticKeyFrame upload(const MapDelta& made);
  /// Returns an upload for an edge that has no map yet: this keyframe, its best covisible
  /// keyframes, and all their points. Numbering of slices restarts.
  SemanticKeyFrame upload_whole(KeyFrameId keyframe);
  /// Applies a slice. Returns false if it is of another map or not newer than the last one.
  bool apply(Worker& worker, const OptResult& result);
  /// Bounds the map while no slices come: keeps the newest uploaded keyframes and all references
  /// since the last but one. With fewer keyframes, points have too few observations for new
  /// references, and tracking is lost when slices come again.
  void keep_newest(Worker& worker);
  /// Deletes points and observations on what moves. Later slices do not bring the points back.
  void cull(const Labels& labels);
  void reset();

  std::uint64_t applied_slice() const { return applied_; }
  KeyFrameId map_id() const { return map_id_; }
  int uploaded() const { return uploads_; }

 private:
  void note_own(const MapDelta& made);
  bool known_at_edge(MapPointId point) const;
  void add_points(const MapView& view, NewKeyFrame& keyframe, MapDelta& delta);
  void put(const MapDelta& local);
  void forget_left(KeyFrameId newest);
  void forget_ids(KeyFrameId oldest);
  void report(const OptResult& result, double scale, double moved);

  MobileNode& node_;
  Options options_;
  LocalMapper mapper_;
  MapWindow window_;                       ///< the edge's window as of the last slice
  std::map<KeyFrameId, OwnKeyFrame> own_;  ///< of the window and newer
  std::set<KeyFrameId> uploaded_;          ///< of the window and newer
  int uploads_ = 0;                        ///< in this map so far
  /// Own points that were uploaded, and points that a mask culled, with the newest keyframe at that
  /// time. Entries older than the window go once their points are in neither window nor local map.
  std::map<MapPointId, KeyFrameId> sent_, on_movers_;
  MapPointId newest_edge_point_;  ///< of all slices so far
  KeyFrameId map_id_;
  std::uint64_t applied_ = 0;
};

}  // namespace slambed::edgeslam_semantic
