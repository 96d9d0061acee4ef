// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "node/mobile_node.hpp"
#include "offload/channels/message_codec.hpp"

namespace slambed {

/// Sends keyframes from the tracking worker: serializing counts as tracking time, as Edge-SLAM
/// does.
class KeyFrameUplink {
 public:
  KeyFrameUplink(MobileNode& node, Channel& channel, MessageCodec codec = {})
      : node_(node), channel_(channel), codec_(std::move(codec)) {}

  /// What goes along with a keyframe.
  struct About {
    KeyFrameNeed need = KeyFrameNeed::kIfMapperAgrees;
    bool first = false;  ///< the edge's map begins with it
    bool whole = false;  ///< the delta has all points that the keyframe sees
    bool after_relocalization = false;
    std::uint64_t applied_update = 0;
    MapPointId newest_edge_point{};
  };
  /// A delta of two keyframes (a single camera's map begins with them) is sent as one, named by the
  /// later; an empty delta sends nothing.
  void send(Worker& worker, const TrackedFrame& frame, MapDelta delta, const About& about);
  /// Of the last message on the channel, 0 when there was none.
  std::uint64_t last_sequence() const { return last_sequence_; }

 private:
  MobileNode& node_;
  Channel& channel_;
  MessageCodec codec_;
  std::uint64_t last_sequence_ = 0;
};

}  // namespace slambed
