// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "map/map.hpp"
#include "map/slot_table.hpp"
#include "slam/frame.hpp"

namespace slambed {

/// The tracker's copy of the part of the map around the current frame: keyframes that share points
/// with it, their neighbors, and all their points. It is copied again only when the map or the set
/// of keyframes has changed, and counts observations (found, visible) until a delta carries them
/// away. (ORB-SLAM2's UpdateLocalMap.)
class LocalView {
 public:
  /// Largest list of keyframes that still grows by neighbors (ORB-SLAM2).
  static constexpr std::size_t kMaxKeyFrames = 80;

  /// A point and the tracker's notes on it.
  struct Mark {
    std::uint32_t collected = 0;           ///< number of the copy that holds it
    std::uint32_t look = 0;                ///< last search that matched or looked for it
    std::uint32_t visible = 0, found = 0;  ///< observations not yet handed on
  };

  /// What one look at the map found.
  struct Update {
    KeyFrameId reference;  ///< most votes, none when nothing in the frame is known
    SE3 T_rw;
    bool copied = false;
  };

  /// Chooses the keyframes by the frame's votes and copies their points. Matches of the frame whose
  /// points are gone are taken away. may_refer tells which keyframes can become the reference.
  template <typename MayRefer>
  Update update(const Map& map, Frame& frame, MayRefer&& may_refer) {
    return map.read([&](const MapView& view) {
      vote(view, frame);
      Update result;
      int most = 0;
      for (const Vote& v : votes_) {
        if (v.count < most || !may_refer(v.id)) continue;  // of equals the newest
        most = v.count;
        result.reference = v.id;
      }
      if (result.reference) result.T_rw = view.keyframe(result.reference)->T_cw;
      result.copied = collect(view);
      return result;
    });
  }

  /// Copies what lies around a keyframe, for a frame with no matches; nothing when it is not there.
  void gather_around(const Map& map, KeyFrameId keyframe);

  std::span<const PointSketch> points() const { return points_; }
  /// The tracker's notes on points()[i].
  Mark& mark(std::size_t i) { return *marks_of_points_[i]; }
  Mark* mark(MapPointId id) { return marks_.make(id); }

  /// A search begins; returns its number for Mark::look. What the one before it saw and nobody kept
  /// is forgotten: a wrong pose says nothing about the points that it does not see.
  std::uint32_t begin_look();
  /// Notes observations in this search.
  void count_visible(std::size_t i) { seen_.push_back({points_[i].id, marks_of_points_[i], 0}); }
  void count_visible(MapPointId id) {
    if (Mark* m = mark(id)) seen_.push_back({id, m, 0});
  }
  void count_found(MapPointId id) {
    if (Mark* m = mark(id)) seen_.push_back({id, m, 1});
  }
  /// The pose of this search was right: its observations count.
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
    int found;  ///< 0: should be visible
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
  std::vector<PointObservation> seen_;  ///< in the search at hand
  std::vector<MapPointId> observed_;
};

}  // namespace slambed
