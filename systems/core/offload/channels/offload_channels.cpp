// SPDX-License-Identifier: Apache-2.0
#include "offload/channels/offload_channels.hpp"

#include "offload/channels/message_codec.hpp"

namespace slambed {

OffloadChannels::OffloadChannels(Runtime& runtime, Network& network, Observer& observer,
                                 const Parameters& parameters)
    : control(network.open({.name = "control", .heartbeat = true})),
      keyframe(open(runtime, network, observer, writes_text(parameters),
                    {.name = "keyframe",
                     .send_queue = parameters.integer("keyframe_queue"),
                     .receive_queue = parameters.integer("keyframe_queue")})),
      map(open(runtime, network, observer, writes_text(parameters),
               {.name = "map", .receive_queue = 1})),
      frame(open(runtime, network, observer, writes_text(parameters),
                 {.name = "frame", .send_queue = 1, .receive_queue = 1})) {}

Channel& OffloadChannels::open(Runtime& runtime, Network& network, Observer& observer, bool waits,
                               const ChannelOptions& options) {
  if (!waits) return network.open(options);
  Channel& below = network.open({.name = options.name, .max_payload = options.max_payload});
  waiting_.push_back(std::make_unique<StopAndWaitChannel>(runtime, observer, below, options));
  return *waiting_.back();
}

void OffloadChannels::start() {
  for (const auto& channel : waiting_) channel->start();
}

}  // namespace slambed
