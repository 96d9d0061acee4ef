// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "map/appearance.hpp"
#include "map/map.hpp"
#include "map/slot_table.hpp"

namespace slambed {

/// What an edit did to the map.
enum class Edit { kApplied, kNothing, kStale, kUnknown };

/// The map itself, without a lock: elements in dense slots, edits, and the state derived from them.
/// Edits only note what they touched; finish() refreshes what follows from it, once per commit.
class MapState final : public MapView {
 public:
  const KeyFrame* keyframe(KeyFrameId id) const override;
  const MapPoint* point(MapPointId id) const override;
  MapPointId resolve(MapPointId id) const override;
  std::optional<SE3> pose_of(KeyFrameId id) const override;
  std::vector<KeyFrameId> keyframe_ids() const override;
  std::vector<MapPointId> point_ids() const override;
  std::size_t keyframe_count() const override { return keyframe_count_; }
  std::size_t point_count() const override { return point_count_; }
  KeyFrameId origin() const override { return origin_; }
  std::uint64_t epoch() const override { return epoch_; }
  std::uint64_t revision() const override { return revision_; }
  const KeyFrameJournal& keyframe_journal() const override { return journal_; }

  Edit put(const NewPoint& edit);
  Edit put(const NewKeyFrame& edit);
  Edit attach(const ObservationEdit& edit);
  Edit detach(const ObservationEdit& edit);
  Edit fuse(const PointFusion& edit);
  Edit move(const PointPosition& edit);
  Edit move(const KeyFramePose& edit);
  Edit count(const PointObservationCounts& edit);
  Edit cull(MapPointId id);
  Edit cull(KeyFrameId id);
  /// Refreshes everything derived from what was touched since the last call.
  void finish();
  void set_epoch(std::uint64_t epoch) { epoch_ = epoch; }
  void set_revision(std::uint64_t revision) { revision_ = revision; }
  void clear();

 private:
  struct Node : KeyFrame {
    void place(const SE3& pose) {
      T_cw = pose;
      minus_center = pose.R.transpose() * pose.t;
    }
    Eigen::Vector3d minus_center;  ///< of the camera, in the world; many points ask for it
    bool touched = false;          ///< connected changed in this commit
  };
  /// What stays of a culled keyframe: its pose relative to the parent it had, or to the world.
  struct Tombstone {
    KeyFrameId parent;
    SE3 T_cp;
  };
  struct KeyFrameSlot {
    std::unique_ptr<Node> live;
    std::unique_ptr<Tombstone> tombstone;
  };
  struct PointSlot {
    std::unique_ptr<MapPoint> live;
    MapPointId survivor;      ///< of a fused point
    bool gone = false;        ///< was culled or fused
    std::uint32_t touch = 0;  ///< 1 + place in touched_points_
  };
  struct Touch {
    MapPointId id;
    int weight_before = 0;
    bool observations = false, position = false, fresh = false;
  };

  Node* node(KeyFrameId id);
  const Node* node(KeyFrameId id) const;
  MapPoint* live_point(MapPointId id);
  Touch& touch(PointSlot& slot, MapPointId id);
  void touch(Node& keyframe);

  // Edits of one observation, both sides and the covisibility counts (map_state.cpp).
  void link(Node& keyframe, std::uint16_t feature, PointSlot& slot, MapPointId id,
            bool counts = true);
  void unlink(Node& keyframe, std::uint16_t feature);
  void change_shared(Node& a, Node& b, int change);
  void drop_observations(MapPoint& point);

  // Derived state (map_refresh.cpp).
  void refresh_point(const Touch& touched);
  void refresh_covisibles(Node& keyframe);

  // Spanning tree (map_tree.cpp).
  bool descends_from(const Node& keyframe, KeyFrameId ancestor) const;
  void set_parent(Node& keyframe, KeyFrameId parent);
  void adopt_orphans();
  void hand_on_children(Node& gone);

  SlotTable<KeyFrameId, KeyFrameSlot> keyframes_;
  SlotTable<MapPointId, PointSlot> points_;
  std::size_t keyframe_count_ = 0, point_count_ = 0;
  KeyFrameId origin_;
  std::uint64_t epoch_ = 0, revision_ = 0;
  KeyFrameJournal journal_;

  std::vector<Touch> touched_points_;
  std::vector<KeyFrameId> touched_keyframes_;
  struct ParentRequest {
    KeyFrameId child, parent;
  };
  std::vector<ParentRequest> requested_parents_;  ///< of new keyframes, none: to be chosen

  DescriptorChooser chooser_;
  std::vector<const Descriptor*> seen_as_;
};

}  // namespace slambed
