// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <map>
#include <mutex>

#include "node/edge_node.hpp"
#include "offload/channels/message_codec.hpp"
#include "slam/place_index.hpp"
#include "store/map_file.hpp"

namespace slambed {

/// Result of joining a trip to the archive.
struct JoinedTrip {
  std::size_t keyframes = 0;  ///< that the archive did not have
  int loops = 0;              ///< closed while joining
  bool adjusted = false;      ///< a global bundle adjusted the whole map
};

/// Adds the keyframes of a finished trip to the map of all trips, which may have some of them
/// already. Closes loops for each in the order of the trip, then runs a global bundle to its end.
JoinedTrip join_trip(Map& archive, const std::shared_ptr<PlaceIndex>& places,
                     std::span<const MapDelta> trip);

/// The edge's side of an upload: receives the keyframes that stayed on the vehicle during the trip,
/// on their own channel.
class TripUpload {
 public:
  TripUpload(EdgeNode& node, Channel& channel, MessageCodec codec)
      : node_(node), channel_(channel), codec_(std::move(codec)) {}

  void start();
  /// Joins the received keyframes to the archive and writes cloud_map.slm to the folder. Call it
  /// after all workers have ended. info: of the archive.
  void leave(Map& archive, const std::shared_ptr<PlaceIndex>& places, const MapInfo& info,
             const std::filesystem::path& folder);

 private:
  void receive(Worker& worker);
  void on_keyframe(Worker& worker, const Message& raw);

  EdgeNode& node_;
  Channel& channel_;
  MessageCodec codec_;
  std::map<KeyFrameId, MapDelta> keyframes_;  ///< used by the receiving worker, then by leave()
  std::atomic<bool> whole_{false};            ///< the upload is complete
};

}  // namespace slambed
