// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <filesystem>

#include "node/edge_node.hpp"
#include "offload/channels/message_codec.hpp"
#include "offload/maps/prior_map.hpp"
#include "offload/shutdown/shutdown.hpp"
#include "runtime/mailbox.hpp"
#include "slam/remote_mapper.hpp"

namespace slambed {

// NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init): -Werror refuses one left out
struct RemoteMappingOptions {
  std::filesystem::path prior_map;  ///< of earlier trips
  int queue;                        ///< keyframes that may wait; the oldest is dropped
  RemoteMapperOptions mapper;
  MessageCodec codec;
};

/// CloudSLAM's edge during a trip: receives keyframes, locates one after the other in the map of
/// earlier trips, and answers each with a pose, also those that match nothing.
class RemoteMapping final : public ShutdownSource {
 public:
  /// Throws bad_input for a map that is missing, damaged, empty, or of another camera than the
  /// mobile's. The camera is checked again later because the mobile may not have connected yet.
  RemoteMapping(EdgeNode& node, Channel& keyframes, RemoteMappingOptions options);

  void start();
  /// The map of earlier trips, with the keyframes of this one that were found in it.
  const std::shared_ptr<Map>& map() const { return prior_.map; }
  const MapInfo& info() const { return prior_.info; }
  const std::shared_ptr<PlaceIndex>& places() const { return places_; }

  void drain(Worker& worker, std::uint64_t last_sequence, RunTime transit,
             RunTime deadline) override;
  std::vector<KeyFramePose> all_poses() const override { return {}; }
  MapCounts counts() const override { return count(*prior_.map); }

 private:
  struct Received {
    wire::KeyFrameMessage message;
    bool estimated = true;  ///< false: the mobile's map is not aligned yet
    RunTime sent{}, received{};
  };

  void receive(Worker& worker);
  void on_keyframe(Worker& worker, const Message& raw);
  void work(Worker& worker);
  void answer(Worker& worker, Received received);
  void bundle(Worker& worker, KeyFrameId keyframe);

  EdgeNode& node_;
  Channel& channel_;
  RemoteMappingOptions options_;
  PriorMap prior_;  ///< its map grows by the keyframes that are found in it
  std::shared_ptr<PlaceIndex> places_;
  RemoteMapper mapper_;
  Mailbox<Received> queue_;
  std::unique_ptr<Signal> progressed_;
  std::atomic<std::uint64_t> received_sequence_{0};
  std::atomic<int> open_{0};  ///< keyframes received and neither answered nor dropped
};

}  // namespace slambed
