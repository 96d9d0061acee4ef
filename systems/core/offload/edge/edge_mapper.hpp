// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <mutex>
#include <optional>
#include <vector>

#include "node/edge_node.hpp"
#include "node/local_mapping.hpp"
#include "node/loop_closing.hpp"
#include "offload/edge/loop_correction_log.hpp"
#include "offload/uplink/keyframe_intake.hpp"

namespace slambed {

// NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init): -Werror refuses one left out
struct EdgeMapperOptions {
  int queue_limit;     ///< keyframes that may wait for the mapper
  bool loop_closing;   ///< look for loops in the global map and close them
  int max_frames = 0;  ///< ORB-SLAM2's mMaxFrames; 0: a second at the played rate
  LocalMapperOptions mapping{};
  std::shared_ptr<Map> prior{};  ///< what the global map begins with; null: nothing
};

/// What others do on an edge, from a keyframe's arrival until it is mapped. On the mapping worker,
/// where nothing else is said.
struct EdgeHooks {
  /// A keyframe was received, wanted or not; on the receiving worker. May be left out.
  std::function<void(const wire::KeyFrameMessage&)> received{};
  /// A keyframe is in the map, its stages begin.
  std::function<void()> begun;
  /// After a keyframe was mapped, before loops are looked for; times: until mapped.
  std::function<void(Worker&, const wire::UpdateTimes&)> mapped;
  /// When no keyframe waits; returns when it wants to be called again.
  std::function<RunTime(Worker&)> idle;
  /// The map was thrown away: a new one begins. On the worker that admitted its first keyframe.
  std::function<void()> cleared;
  /// In place of rebase_keyframe: an admitted keyframe as it fits the map now. May be left out.
  std::function<MapDelta(const MapView&, MapDelta)> rebase{};
};

/// The global map of an edge and all that changes it: local mapping, loops, what the mobile changed
/// itself. Knows which keyframes were admitted and mapped.
class EdgeMapper final : public KeyFrameRecipient {
 public:
  EdgeMapper(EdgeNode& node, EdgeMapperOptions options, EdgeHooks hooks);

  void start();
  const std::shared_ptr<Map>& map() const { return map_; }
  /// Which keyframes of the map look alike; follows the map.
  const std::shared_ptr<PlaceIndex>& places() const { return places_; }

  MapperStatus status() const { return mapping_.status(); }
  void received(const wire::KeyFrameMessage& message) override {
    if (hooks_.received) hooks_.received(message);
  }
  /// Edge-SLAM's admission; see admission.hpp.
  std::optional<std::string_view> keyframe_decline_reason(
      const wire::KeyFrameMessage& message) const override;
  /// Takes a keyframe in; with the first of a new map the old one goes.
  void admit(Worker& worker, AdmittedKeyFrame keyframe) override;

  /// Reads the map for an update: read(number). See LoopCorrectionLog.
  template <typename Read>
  auto read_for_update(Read read) {
    return corrections_.update(read);
  }
  /// read(number, corrected): also whether a loop correction has moved the map since the update
  /// with the number applied.
  template <typename Read>
  auto read_for_update(std::uint64_t applied, Read read) {
    return corrections_.update(applied, read);
  }
  /// How many loop corrections have moved the map so far.
  std::uint64_t loop_corrections() const { return corrections_.count(); }
  /// Where every keyframe that was ever admitted is now, culled ones through their parents.
  std::vector<KeyFramePose> all_poses() const;
  /// The latest mapped keyframes that still exist, newest first, at most count; those of the prior
  /// map only while there is no other, or to fill up: then the newest one's covisibles.
  std::vector<KeyFrameId> latest(int count) const;
  /// The last keyframe that was mapped or merged; none before the first.
  KeyFrameId newest() const;
  /// The newest keyframe whose new points are past their probation: no observation counts about
  /// them are needed any more (wire::MapUpdate::newest_past_probation).
  KeyFrameId newest_past_probation() const;

  /// Waits until all that was admitted is mapped; what closed loops leave to do is dropped at the
  /// deadline.
  void drain(Worker& worker, RunTime deadline);
  /// Mapping rests: no keyframe is admitted. What is being mapped is finished.
  void park(bool parked) { mapping_.park(parked); }
  /// Lets the mapping side come round to the hook `idle`. From any worker.
  void wake() { mapping_.wake(); }
  /// Takes over what was changed elsewhere while mapping rested. Keyframes that waited are dropped:
  /// the changes have them. From any worker but mapping's own.
  CommitReport merge(Worker& worker, MapDelta changes);

 private:
  /// Waits for the mapper: one keyframe, or the two that a single camera's map begins with, which
  /// are committed and mapped as one.
  struct Pending {
    std::vector<KeyFrameId> ids;
    AdmittedKeyFrame keyframe;
  };

  MappingHooks mapping_hooks();
  void clear(Worker& worker);
  bool insert_pending(KeyFrameId keyframe);
  void mapped(Worker& worker, KeyFrameId keyframe);

  EdgeNode& node_;
  EdgeMapperOptions options_;
  EdgeHooks hooks_;
  std::shared_ptr<Map> map_;
  std::shared_ptr<PlaceIndex> places_;
  LocalMapping mapping_;
  std::optional<LoopClosing> loops_;
  LoopCorrectionLog corrections_;

  mutable std::mutex mutex_;  ///< guards what follows
  double last_admitted_s_ = -1;
  std::map<KeyFrameId, Pending> pending_;
  std::vector<KeyFrameId> admitted_;          ///< in order of arrival, those of the prior map first
  std::vector<KeyFrameId> mapped_keyframes_;  ///< in order of mapping, likewise
  std::size_t begun_with_ = 0;                ///< the first so many of both are the prior map's
};

}  // namespace slambed
