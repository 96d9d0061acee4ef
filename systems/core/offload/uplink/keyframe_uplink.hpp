// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "node/mobile_node.hpp"
#include "offload/channels/message_codec.hpp"

namespace slambed {

/// Sends keyframes on the tracking worker: serializing counts as tracking time, as in Edge-SLAM.
class KeyFrameUplink {
 public:
  KeyFrameUplink(MobileNode& node, Channel& channel, MessageCodec codec = {})
      : node_(node), channel_(channel), codec_(std::move(codec)) {}

  /// Properties sent with a keyframe.
  struct About {
    KeyFrameNeed need = KeyFrameNeed::kIfMapperAgrees;
    bool first = false;  ///< the edge's map begins with it
    bool whole = false;  ///< the delta has all points that the keyframe sees
    bool after_relocalization = false;
    std::uint64_t applied_update = 0;
    MapPointId newest_edge_point{};
  };
  /// Sends the delta as one message. The two initial keyframes of a monocular map go together,
  /// under the later one's id. An empty delta sends nothing.
  void send(Worker& worker, const TrackedFrame& frame, MapDelta delta, const About& about);
  /// Sequence of the last message on the channel; 0: none.
  std::uint64_t last_sequence() const { return last_sequence_; }

 private:
  MobileNode& node_;
  Channel& channel_;
  MessageCodec codec_;
  std::uint64_t last_sequence_ = 0;
};

}  // namespace slambed
