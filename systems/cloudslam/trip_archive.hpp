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

/// What joining a trip to the archive came to.
struct JoinedTrip {
  std::size_t keyframes = 0;  ///< that came after the trip
  int loops = 0;              ///< closed on the way
  bool adjusted = false;      ///< the whole map was
};

/// Takes the keyframes of a finished trip into the map of all trips, which may have some of them
/// already: full loop closing for each in the order of the trip, then a global bundle. Takes as
/// long as it takes.
JoinedTrip join_trip(Map& archive, const std::shared_ptr<PlaceIndex>& places,
                     std::span<const MapDelta> trip);

/// The edge's side of an upload: keyframes that stayed on the vehicle during the trip, on a channel
/// of their own.
class TripUpload {
 public:
  TripUpload(EdgeNode& node, Channel& channel, MessageCodec codec)
      : node_(node), channel_(channel), codec_(std::move(codec)) {}

  void start();
  /// Joins what came and leaves cloud_map.slm in the folder. After all workers have ended.
  /// info: of the archive.
  void leave(Map& archive, const std::shared_ptr<PlaceIndex>& places, const MapInfo& info,
             const std::filesystem::path& folder);

 private:
  void receive(Worker& worker);
  void on_keyframe(Worker& worker, const Message& raw);

  EdgeNode& node_;
  Channel& channel_;
  MessageCodec codec_;
  std::map<KeyFrameId, MapDelta> keyframes_;  ///< of the receiving worker, then of leave()
  std::atomic<bool> whole_{false};            ///< nothing more will come
};

}  // namespace slambed
