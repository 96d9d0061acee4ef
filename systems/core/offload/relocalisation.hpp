// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "node/mobile_node.hpp"
#include "offload/edge_mapping.hpp"
#include "slam/place_index.hpp"

namespace slambed {

/// The mobile's side: while tracking is lost, asks the edge where it is, at most once per period.
class RelocalisationRequests {
 public:
  RelocalisationRequests(Channel& frames, Duration period, MessageCodec codec = {})
      : channel_(frames), period_(period), codec_(std::move(codec)) {}
  void after_frame(Worker& worker, const TrackedFrame& frame);

 private:
  Channel& channel_;
  Duration period_;
  MessageCodec codec_;
  RunTime last_ = RunTime::min();
};

struct RelocalisationOptions {
  Duration map_period = std::chrono::seconds(1);  ///< between two maps sent
  int max_candidates = 5;
  int covisibles = 2;  ///< sent beside each candidate
  MessageCodec codec{};
};

/// The edge's side: finds keyframes that look like the frame and sends them with the latest ones.
class RelocalisationService {
 public:
  RelocalisationService(EdgeNode& node, EdgeMapping& mapping, Channel& frames, int update_keyframes,
                        RelocalisationOptions options);
  void start();

 private:
  void serve(Worker& worker);
  std::vector<KeyFrameId> find(const wire::FrameMessage& frame);

  EdgeNode& node_;
  EdgeMapping& mapping_;
  Channel& channel_;
  int update_keyframes_;
  RelocalisationOptions options_;
  std::shared_ptr<PlaceIndex> places_;
};

}  // namespace slambed
