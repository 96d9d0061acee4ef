// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "offload/channels/message_codec.hpp"
#include "offload/edge/update_sender.hpp"
#include "offload/relocalization/relocalization.hpp"

namespace slambed {

/// The mobile's side of Edge-SLAM's relocalization: while tracking is lost, sends a frame to the
/// edge at most once per period. The answer arrives as a map update.
class MobileRelocalizationByMap final : public MobileRelocalization {
 public:
  MobileRelocalizationByMap(Channel& frames, Duration period, MessageCodec codec)
      : channel_(frames), period_(period), codec_(std::move(codec)) {}
  void after_frame(Worker& worker, const TrackedFrame& frame) override;

 private:
  Channel& channel_;
  Duration period_;
  MessageCodec codec_;
  RunTime last_ = RunTime::min();
};

// NOLINTNEXTLINE(cppcoreguidelines-pro-type-member-init): -Werror refuses one left out
struct MapRelocalizationOptions {
  Duration period;  ///< least time between two answers
  int max_candidates;
  int covisibles;  ///< best covisibles sent with each candidate
  int latest;      ///< number of latest keyframes sent along
  MessageCodec codec;
};

/// The edge's side: sends keyframes that look like the frame, and the latest ones, as the mobile's
/// new map, in which it relocalizes itself.
class EdgeRelocalizationByMap final : public EdgeRelocalization {
 public:
  EdgeRelocalizationByMap(EdgeNode& node, Channel& frames, EdgeMapper& mapper,
                          UpdateSender& updates, MapRelocalizationOptions options)
      : node_(node),
        channel_(frames),
        mapper_(mapper),
        updates_(updates),
        options_(std::move(options)) {}
  void start() override;

 private:
  void serve(Worker& worker);
  std::vector<KeyFrameId> alike(const wire::FrameMessage& frame) const;
  /// Returns false when there was nothing to send.
  bool send(Worker& worker, const Message& raw, std::vector<KeyFrameId> found);

  EdgeNode& node_;
  Channel& channel_;
  EdgeMapper& mapper_;
  UpdateSender& updates_;
  MapRelocalizationOptions options_;
};

}  // namespace slambed
