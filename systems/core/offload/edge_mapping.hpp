// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <mutex>
#include <optional>
#include <vector>

#include "node/edge_node.hpp"
#include "node/local_mapping.hpp"
#include "node/loop_closing.hpp"
#include "offload/admission.hpp"
#include "offload/map_jumps.hpp"
#include "offload/message_codec.hpp"

namespace slambed {

struct EdgeMappingOptions {
  int queue_limit = 3;        ///< keyframes that may wait for the mapper
  int update_keyframes = 6;   ///< n_KF: the latest mapped keyframes that an update carries
  int update_neighbours = 0;  ///< best covisibles of the newest one besides
  Duration update_period{};   ///< at least so long between two updates; 0: after each keyframe
  bool update_poses = true;   ///< an update also says where other keyframes moved
  bool loop_closing = true;   ///< look for loops in the global map and close them
  MessageCodec codec{};
};

/// Edge-SLAM's edge: a receiver that parses and admits keyframes, the mapper on the global map, and
/// map updates that leave from the mapping worker when they are due.
class EdgeMapping {
 public:
  EdgeMapping(EdgeNode& node, EdgeMappingOptions options, Channel& keyframes, Channel& map);

  void start();
  std::shared_ptr<Map> map() const { return map_; }
  /// Which keyframes of the map look alike.
  std::shared_ptr<PlaceIndex> places() const { return places_; }
  LocalMapping& mapping() { return mapping_; }
  /// Called on the mapping worker after each mapped keyframe and before an update is made.
  void on_mapped(std::function<void(Worker&, KeyFrameId)> mapped) { mapped_ = std::move(mapped); }

  /// Answers keyframes that no map can start with by KEYFRAME_WANTED. Before start().
  void ask_when_empty() { asks_ = true; }

  /// Waits until the keyframe with this sequence has come, or until transit, and all are mapped;
  /// what closed loops leave to do is dropped at the deadline.
  void drain(Worker& worker, std::uint64_t last_sequence, RunTime transit, RunTime deadline);
  /// Where every keyframe that was ever accepted is now, culled ones through their parents.
  std::vector<KeyFramePose> all_poses() const;
  /// The latest mapped keyframes that still exist, newest first, at most count.
  std::vector<KeyFrameId> latest(int count) const;
  /// Sends these keyframes as a local map; newest and times describe the last mapped keyframe.
  void send_update(Worker& worker, wire::UpdateTimes times, KeyFrameId newest,
                   const std::vector<KeyFrameId>& keyframes, bool relocalisation);
  RunTime last_sent() const;
  /// Regular updates pause while the mobile asks for relocalisation.
  void hold_updates(bool held);

  /// Mapping rests: no keyframe is admitted, no map leaves, of any kind. What is being mapped is
  /// finished.
  void stop();
  /// Takes over what was changed elsewhere while mapping rested. Keyframes that waited are dropped:
  /// the changes have them. From any worker but mapping's own.
  CommitReport merge(Worker& worker, MapDelta changes);
  /// Maps again; maps that leave carry the epoch.
  void resume(std::uint64_t epoch);

 private:
  struct Pending {
    wire::KeyFrameMessage message;
    wire::UpdateTimes times;
  };

  /// wire::MapUpdate::settled as of now.
  KeyFrameId settled() const;
  void receive(Worker& worker);
  void admit(Worker& worker, const Message& raw);
  void begin_again(Worker& worker);
  bool take(KeyFrameId keyframe);
  void mapped(Worker& worker, KeyFrameId keyframe);
  RunTime update_if_due(Worker& worker);
  std::vector<KeyFramePose> moved_poses(const MapDelta& update);

  EdgeNode& node_;
  EdgeMappingOptions options_;
  Channel& keyframe_channel_;
  Channel& map_channel_;
  std::shared_ptr<Map> map_ = std::make_shared<Map>();
  std::shared_ptr<PlaceIndex> places_;
  LocalMapping mapping_;
  std::optional<LoopClosing> loops_;
  MapJumps jumps_;
  std::function<void(Worker&, KeyFrameId)> mapped_;
  std::unique_ptr<Signal> received_;
  bool asks_ = false;

  mutable std::mutex mutex_;  ///< guards what follows
  std::uint64_t received_sequence_ = 0;
  double last_accepted_s_ = -1;
  std::map<KeyFrameId, Pending> pending_;
  std::vector<KeyFrameId> accepted_;          ///< in order of arrival
  std::vector<KeyFrameId> mapped_keyframes_;  ///< in order of mapping
  wire::UpdateTimes newest_times_;
  bool news_ = false;  ///< a keyframe was mapped since the last update
  bool held_ = false, stopped_ = false;
  std::uint64_t epoch_ = 0;
  RunTime last_sent_ = RunTime::min();
  std::map<KeyFrameId, SE3> told_;  ///< poses the mobile was told last
};

}  // namespace slambed
