// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "node/edge_node.hpp"
#include "node/messaging.hpp"
#include "node/mobile_node.hpp"
#include "wire/messages.hpp"

namespace slambed {

/// The mobile's side of the shutdown: sends BYE and waits a limited time for the edge's final poses
/// and counts.
class MobileShutdown {
 public:
  MobileShutdown(MobileNode& node, Channel& control);

  void shut_down(Worker& worker, std::uint64_t last_keyframe_sequence);
  const MapCounts& counts() const { return counts_; }  ///< of the global map; zero if unanswered
  /// Enters the final poses that the edge has sent.
  void place_keyframes(PoseBook& book) const;
  bool answered() const { return answered_; }

 private:
  MobileNode& node_;
  Channel& control_;
  Inbox inbox_;
  bool answered_ = false;
  MapCounts counts_;
  std::vector<KeyFramePose> poses_;
};

/// What an edge finishes and reports at the end of a run.
class ShutdownSource {
 public:
  virtual ~ShutdownSource() = default;
  /// Waits for the keyframe with this sequence, at most until `transit`, and then until all are
  /// mapped. Work that remains after that is dropped at the deadline.
  virtual void drain(Worker& worker, std::uint64_t last_sequence, RunTime transit,
                     RunTime deadline) = 0;
  virtual std::vector<KeyFramePose> all_poses() const = 0;
  virtual MapCounts counts() const = 0;
};

struct EdgeShutdownOptions {
  bool final_poses = true;
  /// The edge gives up when the mobile has been disconnected for this long.
  Duration patience = std::chrono::seconds(30);
  /// Receives all other messages on the control channel.
  std::function<void(const Message&)> other{};
};

/// The edge's control worker: ends the node after BYE or when the mobile is gone for good.
class EdgeShutdown {
 public:
  EdgeShutdown(EdgeNode& node, Channel& control, ShutdownSource& source,
               EdgeShutdownOptions options)
      : node_(node), control_(control), source_(source), options_(std::move(options)) {}

  void start();

 private:
  void listen(Worker& worker);
  bool answer(Worker& worker, const Message& message);

  EdgeNode& node_;
  Channel& control_;
  ShutdownSource& source_;
  EdgeShutdownOptions options_;
};

}  // namespace slambed
