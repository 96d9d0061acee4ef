// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "map/map.hpp"
#include "map/slot_table.hpp"
#include "slam/frame.hpp"

namespace slambed {

/// The tracker's copy of the map around the current frame (ORB-SLAM2's UpdateLocalMap): keyframes
/// that share points with it, their neighbors, and all their points. It is copied again only if the
/// map or the set of keyframes has changed. It also counts observations (found, visible) until a
/// delta takes them.
class LocalView {
 public:
  /// Neighbors are added until the list has more keyframes than this (ORB-SLAM2).
  static constexpr std::size_t kMaxKeyFrames = 80;

  /// The tracker's notes on a point.
  struct Mark {
    std::uint32_t collected = 0;           ///< number of the copy that holds it
    std::uint32_t look = 0;                ///< last search that skipped it as matched
    std::uint32_t visible = 0, found = 0;  ///< observations not yet in a delta
  };

  /// Result of an update.
  struct Update {
    KeyFrameId reference;  ///< keyframe with the most votes; none if the map has no matched point
    SE3 T_rw;
    bool copied = false;
  };

  /// Chooses keyframes by the votes of the frame's matches and copies their points. Removes matches
  /// whose points are gone. may_refer(id) tells which keyframes can become the reference.
  template <typename MayRefer>
  Update update(const Map& map, Frame& frame, MayRefer&& may_refer) {
    return map.read([&](const MapView& view) {
      vote(view, frame);
      Update result;
      int most = 0;
      for (const Vote& v : votes_) {
        if (v.count < most || !may_refer(v.id)) continue;  // the newest wins a tie
        most = v.count;
        result.reference = v.id;
      }
      if (result.reference) result.T_rw = view.keyframe(result.reference)->T_cw;
      result.copied = collect(view);
      return result;
    });
  }

  /// Copies the points around a keyframe, for a frame without matches; none if the map lacks it.
  void gather_around(const Map& map, KeyFrameId keyframe);

  std::span<const PointSketch> points() const { return points_; }
  /// The tracker's notes on points()[i].
  Mark& mark(std::size_t i) { return *marks_of_points_[i]; }
  Mark* mark(MapPointId id) { return marks_.make(id); }

  /// Starts a search and returns its number for Mark::look. Discards the last search's counts
  /// unless they were kept: a wrong pose proves nothing about points that it misses.
  std::uint32_t begin_look();
  /// Counts an observation in this search.
  void count_visible(std::size_t i) { seen_.push_back({points_[i].id, marks_of_points_[i], 0}); }
  void count_visible(MapPointId id) {
    if (Mark* m = mark(id)) seen_.push_back({id, m, 0});
  }
  void count_found(MapPointId id) {
    if (Mark* m = mark(id)) seen_.push_back({id, m, 1});
  }
  /// Keeps the counts of this search because its pose was right.
  void keep_observation_counts();
  /// All observations since the last call as absolute counters, ascending by id.
  std::vector<PointObservationCounts> take_observation_counts(const Map& map);

  void clear();

 private:
  struct Vote {
    KeyFrameId id;
    int count = 0;
  };
  struct PointObservation {
    MapPointId id;
    Mark* mark;
    int found;  ///< 1: was found; 0: should be visible
  };
  void vote(const MapView& view, Frame& frame);
  bool collect(const MapView& view);
  void add_neighbors(const MapView& view);

  struct KeyFrameMark {
    std::uint32_t round = 0;
    std::int32_t votes = 0;
  };
  SlotTable<KeyFrameId, KeyFrameMark> keyframe_marks_;
  std::uint32_t round_ = 0;
  std::vector<Vote> votes_;            ///< ascending by id
  std::vector<KeyFrameId> chosen_;     ///< keyframes wanted now
  std::vector<KeyFrameId> keyframes_;  ///< keyframes copied
  std::uint64_t revision_ = 0;         ///< of the map when copied
  std::uint32_t copy_ = 0;
  std::vector<PointSketch> points_;
  std::vector<Mark*> marks_of_points_;
  SlotTable<MapPointId, Mark> marks_;
  std::uint32_t look_ = 0;
  std::vector<PointObservation> seen_;  ///< in the current search
  std::vector<MapPointId> observed_;
};

}  // namespace slambed
