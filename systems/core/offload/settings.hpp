// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "node/policy.hpp"
#include "offload/edge_mapping.hpp"
#include "offload/map_downlink.hpp"
#include "offload/stop_and_wait.hpp"

namespace slambed {

/// A system with Edge-SLAM's offloading: its channels, ORB and tracking options. The parameters are
/// those of params.yaml and its own; policies are missing.
System offload_system(std::string name, std::vector<ParameterSpec> parameters);

/// The channels of Edge-SLAM, with its drop-oldest queues on both sides. With the compatibility
/// codec all but control also send as Edge-SLAM does: they wait for acknowledgements.
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

/// One for a node: what it writes it is likely to read again.
MessageCodec message_codec(const Parameters& parameters);

DownlinkOptions downlink_options(const Parameters& parameters, const MessageCodec& codec);
EdgeMappingOptions mapping_options(const Parameters& parameters, const MessageCodec& codec);
/// False where the system has no such parameter.
bool relocalises_on_edge(const Parameters& parameters);
/// The stored map that the edge begins with and the mobile is to be found in; empty: none, also
/// where the system has no such parameter.
std::string edge_prior_map(const Parameters& parameters);

}  // namespace slambed
