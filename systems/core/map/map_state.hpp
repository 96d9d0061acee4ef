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

enum class Edit { kApplied, kNothing, kStale, kUnknown };

/// The map without a lock: elements in dense slots, edits, and derived state. Edits only record
/// what they touched; finish() updates the derived state once per commit.
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
  /// Updates all state derived from elements touched since the last call.
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
    Eigen::Vector3d minus_center;  ///< minus the camera center, world frame; cached for all points
    bool touched = false;          ///< `connected` changed in this commit
  };
  /// What remains of a culled keyframe: its pose relative to its parent, or to the world.
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
    bool gone = false;        ///< culled or fused
    std::uint32_t touch = 0;  ///< 1 + index in touched_points_
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

  // Edits of one observation on both sides, with the covisibility counts (map_state.cpp).
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
  std::vector<ParentRequest> requested_parents_;  ///< of new keyframes; none: by covisibility

  DescriptorChooser chooser_;
  std::vector<const Descriptor*> seen_as_;
};

}  // namespace slambed
