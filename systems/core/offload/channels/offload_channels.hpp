// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "node/parameters.hpp"
#include "offload/channels/stop_and_wait.hpp"
#include "runtime/network.hpp"

namespace slambed {

/// The channels of Edge-SLAM, with its drop-oldest queues on both sides. With the compatibility
/// codec all but control also send as Edge-SLAM does: they wait for acknowledgments.
class OffloadChannels {
 public:
  OffloadChannels(Runtime& runtime, Network& network, Observer& observer,
                  const Parameters& parameters);
  void start();

 private:
  Channel& open(Runtime& runtime, Network& network, Observer& observer, bool waits,
                const ChannelOptions& options);
  std::vector<std::unique_ptr<StopAndWaitChannel>> waiting_;  ///< before the channels: made by open

 public:
  Channel &control, &keyframe, &map, &frame;
};

}  // namespace slambed
