// SPDX-License-Identifier: Apache-2.0
#include "offload/relocalisation.hpp"

#include "offload/pose_requests.hpp"
#include "offload/relocalisation_by_map.hpp"
#include "offload/relocalisation_by_pose.hpp"
#include "offload/settings.hpp"

namespace slambed {

std::unique_ptr<MobileRelocalisation> make_relocalisation(MobileNode& node,
                                                          const Parameters& parameters,
                                                          const MessageCodec& codec,
                                                          OffloadChannels& channels,
                                                          MapDownlink& downlink) {
  if (relocalises_on_edge(parameters))
    return std::make_unique<PoseRequests>(node, channels.frame, channels.control, channels.keyframe,
                                          downlink, codec);
  return std::make_unique<MapRequests>(
      channels.frame, from_seconds(parameters.real("reloc_request_ms") / 1000), codec);
}

std::unique_ptr<EdgeRelocalisation> make_relocalisation(EdgeNode& node,
                                                        const Parameters& parameters,
                                                        const MessageCodec& codec,
                                                        OffloadChannels& channels,
                                                        EdgeMapping& mapping) {
  if (relocalises_on_edge(parameters))
    return std::make_unique<RelocalisationByPose>(
        node, channels.frame, channels.map, mapping.mapper(), mapping.updates(),
        PoseRelocalisationOptions{
            .codec = codec,
            .fail_bytes = static_cast<std::uint64_t>(parameters.integer("reloc_fail_bytes"))});
  return std::make_unique<RelocalisationByMap>(
      node, channels.frame, mapping.mapper(), mapping.updates(),
      MapRelocalisationOptions{.period = from_seconds(parameters.real("reloc_map_period_s")),
                               .max_candidates = parameters.integer("reloc_candidates"),
                               .covisibles = parameters.integer("reloc_covisibles"),
                               .latest = parameters.integer("n_kf"),
                               .codec = codec});
}

}  // namespace slambed
