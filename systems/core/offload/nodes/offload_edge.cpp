// SPDX-License-Identifier: Apache-2.0
#include "offload/nodes/offload_edge.hpp"

#include "offload/nodes/settings.hpp"
#include "offload/relocalization/relocalization_by_map.hpp"

namespace slambed {
namespace {

EdgeMappingOptions with(EdgeMappingOptions options, const OffloadEdgeParts& parts) {
  options.updates.keep_recovery = parts.keep_recovery;
  return options;
}

std::unique_ptr<EdgeRelocalization> by_map(EdgeNode& node, const Parameters& parameters,
                                           OffloadChannels& channels, EdgeMapping& mapping,
                                           const MessageCodec& codec) {
  return std::make_unique<EdgeRelocalizationByMap>(
      node, channels.frame, mapping.mapper(), mapping.updates(),
      MapRelocalizationOptions{.period = from_seconds(parameters.real("reloc_map_period_s")),
                               .max_candidates = parameters.integer("reloc_candidates"),
                               .covisibles = parameters.integer("reloc_covisibles"),
                               .latest = parameters.integer("n_kf"),
                               .codec = codec});
}

}  // namespace

OffloadEdge::OffloadEdge(EdgeNode& node, const Parameters& parameters,
                         const OffloadEdgeParts& parts)
    : codec_(message_codec(parameters)),
      channels_(node.runtime(), node.network(), node.log(), parameters),
      mapping_(node, with(mapping_options(parameters, codec_), parts), channels_.keyframe,
               channels_.map),
      relocalization_(parts.relocalization ? parts.relocalization(node, channels_, mapping_, codec_)
                                           : by_map(node, parameters, channels_, mapping_, codec_)),
      shutdown_(node, channels_.control, mapping_,
                {.final_poses = parameters.boolean("final_poses"),
                 .other = [this](const Message& message) { relocalization_->listen(message); }}) {}

void OffloadEdge::start() {
  channels_.start();
  mapping_.start();
  relocalization_->start();
  shutdown_.start();
}

}  // namespace slambed
