// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <memory>

#include "node/mobile_node.hpp"
#include "wire/frame_messages.hpp"

namespace slambed {

/// The mobile's side of full offload: sends each frame as a picture and receives its pose. Logs
/// `frame_answered` with the parts of the latency, which add up to the whole. A restarted edge
/// starts a new map, so the trajectory restarts too, as after a reset.
class RemoteTracking {
 public:
  /// window: most frames in flight at once; the next frame sent is then the newest one. 0: no
  /// limit, every frame is sent.
  RemoteTracking(MobileNode& node, Channel& frames, int window);

  void start();
  /// Sends the frame and returns when the window has space for another.
  void send(Worker& worker, const OfferedFrame& frame);
  /// Returns when no frame is in flight, or the answers in flight are given up.
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
  std::uint64_t sent_there_ = 0;            ///< last frame sent while an edge was connected
  std::uint64_t sent_to_ = 0;               ///< session of that edge
  std::atomic<std::uint64_t> answered_{0};  ///< last frame that was answered or given up
  std::uint64_t edge_ = 0;  ///< session of the edge whose map the poses refer to; 0: none yet
  std::unique_ptr<Signal> answer_;
};

}  // namespace slambed
