// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <set>

#include "edgeslam_semantic/labels.hpp"
#include "edgeslam_semantic/local_map.hpp"
#include "edgeslam_semantic/messages.hpp"
#include "node/mobile_node.hpp"
#include "slam/local_mapper.hpp"

namespace slambed::edgeslam_semantic {

/// The mobile's local map: what slices brought, and what the mobile made itself since, by
/// triangulation without any bundle. All on the tracking worker, between two frames or behind one.
class MobileMap {
 public:
  struct Options {
    int neighbors;  ///< keyframes that a new one is triangulated with
    int keyframes;  ///< uploaded ones that stay where no slice comes
  };
  MobileMap(MobileNode& node, Options options);

  /// A keyframe was made: triangulates its points.
  void extend(Worker& worker, const MapDelta& made);
  /// What goes up of it, its points with earlier observations of theirs that the edge knows of.
  /// `made`: of the beginning of a map.
  SemanticKeyFrame upload(const MapDelta& made);
  /// What goes up to an edge that knows nothing: its map begins with this keyframe and those that
  /// see most of the same, with all their points. Slices count anew.
  SemanticKeyFrame upload_whole(KeyFrameId keyframe);
  /// Takes a slice over. False when it is of another map, or none that follows the last one.
  bool apply(Worker& worker, const OptResult& result);
  /// No answers come: the newest uploaded keyframes stay, and references since the last but one.
  /// With fewer the next points are seen too seldom for references to be made, and the camera is
  /// lost when slices come again.
  void keep_newest(Worker& worker);
  /// Points and observations on what moves go, and are not taken from slices again.
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
  MapWindow window_;                       ///< as the edge has it, by the last slice
  std::map<KeyFrameId, OwnKeyFrame> own_;  ///< of the window and newer
  std::set<KeyFrameId> uploaded_;          ///< of the window and newer
  int uploads_ = 0;                        ///< in this map so far
  /// Own points that went up, and what a mask took away; by the newest keyframe of that time. Not
  /// of the window alone: what was seen in none but keyframes that left it comes back no more.
  std::map<MapPointId, KeyFrameId> sent_, on_movers_;
  MapPointId newest_edge_point_;  ///< of all that slices told
  KeyFrameId map_id_;
  std::uint64_t applied_ = 0;
};

}  // namespace slambed::edgeslam_semantic
