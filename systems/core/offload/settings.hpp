// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "node/policy.hpp"
#include "offload/edge_mapping.hpp"
#include "offload/map_downlink.hpp"
#include "offload/relocalisation.hpp"
#include "offload/relocalisation_by_pose.hpp"
#include "offload/stop_and_wait.hpp"

namespace slambed {

/// What every system with Edge-SLAM's offloading has alike: parameters (documented in each
/// system.yaml), channels and options made of them. map_updates: the choices of `map_update`.
std::vector<ParameterSpec> offload_parameters(std::vector<std::string> map_updates = {"serial",
                                                                                      "parallel"});
/// Of systems whose updates may be staged, and of those that may relocalise on the edge.
std::vector<ParameterSpec> staging_parameters();
std::vector<ParameterSpec> edge_relocalisation_parameters();

/// A system with these parameters and channels, ORB and tracking options; policies are missing.
System offload_system(std::string name,
                      std::vector<ParameterSpec> parameters = offload_parameters());

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

MessageCodec message_codec(const Parameters& parameters);

DownlinkOptions downlink_options(const Parameters& parameters);
EdgeMappingOptions mapping_options(const Parameters& parameters);
/// False where the system has no such parameter.
bool relocalises_on_edge(const Parameters& parameters);
PoseRelocalisationOptions pose_relocalisation_options(const Parameters& parameters);
RelocalisationOptions relocalisation_options(const Parameters& parameters);
Duration relocalisation_period(const Parameters& parameters);

}  // namespace slambed
