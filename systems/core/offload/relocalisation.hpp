// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>

#include "node/edge_node.hpp"
#include "node/mobile_node.hpp"
#include "offload/message_codec.hpp"

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

/// How an edge tells a lost mobile where it is.
class RelocalisationHelp {
 public:
  /// Tells the mobile; false when there was nothing to tell after all.
  using Answer = std::function<bool(Worker&)>;

  virtual ~RelocalisationHelp() = default;
  /// The mobile has asked, whether or not it will be looked for.
  virtual void asked(const Message&) {}
  /// Looks for the frame. Within the stage that parsed it; empty: not found.
  virtual Answer find(const Message& raw, const wire::FrameMessage& frame) = 0;
};

struct RelocalisationOptions {
  Duration map_period;  ///< between two answers
  int max_candidates;
  int covisibles;  ///< sent beside each candidate
  MessageCodec codec;
};

/// The edge's side: receives frames of a lost mobile and has them answered.
class RelocalisationService {
 public:
  RelocalisationService(EdgeNode& node, Channel& frames, RelocalisationHelp& relocaliser,
                        RelocalisationOptions options)
      : node_(node), channel_(frames), relocaliser_(relocaliser), options_(std::move(options)) {}
  void start();

 private:
  void serve(Worker& worker);

  EdgeNode& node_;
  Channel& channel_;
  RelocalisationHelp& relocaliser_;
  RelocalisationOptions options_;
};

}  // namespace slambed
