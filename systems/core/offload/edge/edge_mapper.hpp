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
  int max_frames = 0;  ///< ORB-SLAM2's mMaxFrames; 0: one second of frames
  LocalMapperOptions mapping{};
  std::shared_ptr<Map> prior{};  ///< initial content of the global map; null: empty
};

/// Callbacks from a keyframe's arrival at the edge until it is mapped. They run on the mapping
/// worker unless noted otherwise.
struct EdgeHooks {
  /// A keyframe was received, admitted or not. Runs on the receiving worker. Optional.
  std::function<void(const wire::KeyFrameMessage&)> received{};
  /// A keyframe was inserted into the map; its mapping stages begin.
  std::function<void()> begun;
  /// A keyframe was mapped; loop detection follows. The times are complete except `due`.
  std::function<void(Worker&, const wire::UpdateTimes&)> mapped;
  /// No keyframe waits. Returns when it wants to be called again.
  std::function<RunTime(Worker&)> idle;
  /// The map was cleared for a new one. Runs on the worker that admits its first keyframe.
  std::function<void()> cleared;
  /// Replaces rebase_keyframe(): adapts an admitted keyframe to the current map. Optional.
  std::function<MapDelta(const MapView&, MapDelta)> rebase{};
};

/// Holds the edge's global map and everything that changes it: local mapping, loop closing, and
/// merges of the mobile's own changes. Records which keyframes were admitted and mapped.
class EdgeMapper final : public KeyFrameRecipient {
 public:
  EdgeMapper(EdgeNode& node, EdgeMapperOptions options, EdgeHooks hooks);

  void start();
  const std::shared_ptr<Map>& map() const { return map_; }
  /// Index for place recognition, kept up to date with the map.
  const std::shared_ptr<PlaceIndex>& places() const { return places_; }

  MapperStatus status() const { return mapping_.status(); }
  void received(const wire::KeyFrameMessage& message) override {
    if (hooks_.received) hooks_.received(message);
  }
  /// Applies Edge-SLAM's admission rules; see admission.hpp.
  std::optional<std::string_view> keyframe_decline_reason(
      const wire::KeyFrameMessage& message) const override;
  /// Queues a keyframe for mapping. The first keyframe of a new map clears the old map.
  void admit(Worker& worker, AdmittedKeyFrame keyframe) override;

  /// Calls read(number) to read the map for an update. See LoopCorrectionLog.
  template <typename Read>
  auto read_for_update(Read read) {
    return corrections_.update(read);
  }
  /// Calls read(number, corrected). corrected: loop closing moved the map since update `applied`.
  template <typename Read>
  auto read_for_update(std::uint64_t applied, Read read) {
    return corrections_.update(applied, read);
  }
  /// How many loop corrections have moved the map so far.
  std::uint64_t loop_corrections() const { return corrections_.count(); }
  /// Returns the current pose of every admitted keyframe; a culled one moves with its parent.
  std::vector<KeyFramePose> all_poses() const;
  /// Returns the latest mapped keyframes that still exist, newest first, at most `count`. If this
  /// trip has too few, the newest one's covisibles fill up the list; if it has none, the prior
  /// map's latest do.
  std::vector<KeyFrameId> latest(int count) const;
  /// The last keyframe that was mapped or merged; none before the first.
  KeyFrameId newest() const;
  /// The newest keyframe whose new points are past probation, so that the edge needs no more
  /// observation counts for them (wire::MapUpdate::newest_past_probation).
  KeyFrameId newest_past_probation() const;

  /// Waits until all admitted keyframes are mapped; cancels a global bundle at the deadline.
  void drain(Worker& worker, RunTime deadline);
  /// While parked, no keyframe is admitted. The keyframe that is being mapped is finished first.
  void park(bool parked) { mapping_.park(parked); }
  /// Makes the mapping worker call the hook `idle`. Any worker may call this.
  void wake() { mapping_.wake(); }
  /// Merges changes that were made elsewhere while mapping was parked. Drops waiting keyframes
  /// because the changes contain them. Call on any worker but the mapping worker.
  CommitReport merge(Worker& worker, MapDelta changes);

 private:
  /// Waits for the mapper: one keyframe, or the two initial keyframes of a monocular map, which are
  /// committed and mapped as one.
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
  std::vector<KeyFrameId> mapped_keyframes_;  ///< in order of mapping, those of the prior map first
  std::size_t begun_with_ = 0;  ///< number of prior-map keyframes at the front of both
};

}  // namespace slambed
