// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <memory>

#include "node/mobile_node.hpp"
#include "wire/frame_messages.hpp"

namespace slambed {

/// Full offload, the mobile's side: each frame goes up as a picture, its pose comes down. Writes
/// `frame_answered` with the parts of the way, which add up to its length. An edge that is started
/// again begins a map, and the trajectory with it, as after a reset.
class RemoteTracking {
 public:
  /// window: frames that may be under way at once, the next one is then the newest there is; 0: no
  /// limit, each is sent.
  RemoteTracking(MobileNode& node, Channel& frames, int window);

  void start();
  /// Sends the frame, and returns when another may go.
  void send(Worker& worker, const OfferedFrame& frame);
  /// Returns when nothing is under way any more, or nothing more is to be expected.
  void drain(Worker& worker);
  std::uint64_t last_sequence() const { return sent_; }

 private:
  void watch_edge(Worker& worker);
  void wait_for(Worker& worker, std::uint64_t most_under_way);
  void give_up_lost();
  void give_up(std::uint64_t last);
  void settle(std::uint64_t upto);
  void receive(Worker& worker);
  void on_result(const Message& message);
  void record(const wire::FrameResult& result, RunTime arrived, std::size_t bytes);

  MobileNode& node_;
  Channel& channel_;
  std::uint64_t window_;
  std::uint64_t sent_ = 0;
  std::uint64_t sent_there_ = 0;  ///< the last one that went to an edge that was there ...
  std::uint64_t sent_to_ = 0;     ///< ... and which one that was (session)
  std::atomic<std::uint64_t> answered_{0};  ///< or given up
  std::uint64_t edge_ = 0;  ///< session of the edge whose map poses are in; 0: none yet
  std::unique_ptr<Signal> answer_;
};

}  // namespace slambed
