// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "node/parameters.hpp"
#include "offload/channels/stop_and_wait.hpp"
#include "runtime/network.hpp"

namespace slambed {

/// Edge-SLAM's channels, with its drop-oldest queues at both ends. With the compatibility codec,
/// every channel except control also waits for acknowledgments, as Edge-SLAM does.
class OffloadChannels {
 public:
  OffloadChannels(Runtime& runtime, Network& network, Observer& observer,
                  const Parameters& parameters);
  void start();

 private:
  Channel& open(Runtime& runtime, Network& network, Observer& observer, bool waits,
                const ChannelOptions& options);
  std::vector<std::unique_ptr<StopAndWaitChannel>> waiting_;  ///< first, because open() adds to it

 public:
  Channel &control, &keyframe, &map, &frame;
};

}  // namespace slambed
