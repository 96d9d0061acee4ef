// SPDX-License-Identifier: Apache-2.0
#include "multithread_rl/multithread_rl.hpp"

#include "base/error.hpp"
#include "edgeslam/policies.hpp"
#include "multithread_rl/parameters.hpp"
#include "multithread_rl/pose_requests.hpp"
#include "multithread_rl/recovering_updates.hpp"
#include "multithread_rl/relocalization_by_pose.hpp"
#include "multithread_rl/staged_updates.hpp"
#include "offload/nodes/settings.hpp"

namespace slambed {
namespace multithread_rl {
namespace {

bool relocalizes_on_edge(const Parameters& parameters) {
  return parameters.text("relocalization") == "edge";
}

bool keeps_recovery(const Parameters& parameters) {
  return relocalizes_on_edge(parameters) && parameters.boolean("keep_recovery_keyframe");
}

void check_prior_map(const Parameters& parameters) {
  // RELOC_OK carries one keyframe, which does not tell the mobile which ids the map already uses.
  if (!parameters.text("prior_map").empty() && relocalizes_on_edge(parameters))
    throw bad_input(
        "params: prior_map needs relocalization: map, by which the mobile begins in it");
}

MapStaging::Backup backup(const Parameters& parameters) {
  const std::string backup = parameters.text("keyframe_backup");
  return backup == "none"     ? MapStaging::Backup::kNone
         : backup == "update" ? MapStaging::Backup::kUpdate
                              : MapStaging::Backup::kUncovered;
}

UpdateApplierMaker applier(const Parameters& parameters) {
  const int recovery_keyframes = keeps_recovery(parameters) ? parameters.integer("n_kf") : 0;
  if (parameters.text("map_update") == "staged")
    return [backup = backup(parameters), recovery_keyframes](
               MobileNode& node, UpdateReceiver& receiver, UpdateCheck& check) {
      return std::make_unique<StagedUpdates>(node, receiver, check, backup, recovery_keyframes);
    };
  return [recovery_keyframes](MobileNode& node, UpdateReceiver& receiver, UpdateCheck& check) {
    return std::make_unique<RecoveringUpdates>(node, receiver, check, recovery_keyframes);
  };
}

OffloadMobileParts mobile_parts(const Parameters& parameters) {
  check_prior_map(parameters);
  OffloadMobileParts parts{.applier = applier(parameters)};
  if (relocalizes_on_edge(parameters))
    parts.relocalization = [](MobileNode& node, OffloadChannels& channels, MapDownlink& downlink,
                              const MessageCodec& codec) {
      return std::make_unique<MobileRelocalizationByPose>(node, channels.frame, channels.control,
                                                          channels.keyframe, downlink, codec);
    };
  return parts;
}

OffloadEdgeParts edge_parts(const Parameters& parameters) {
  check_prior_map(parameters);
  OffloadEdgeParts parts{.keep_recovery = keeps_recovery(parameters)};
  if (relocalizes_on_edge(parameters))
    parts.relocalization = [fail_bytes =
                                static_cast<std::uint64_t>(parameters.integer("reloc_fail_bytes"))](
                               EdgeNode& node, OffloadChannels& channels, EdgeMapping& mapping,
                               const MessageCodec& codec) {
      return std::make_unique<EdgeRelocalizationByPose>(
          node, channels.frame, channels.map, mapping.mapper(), mapping.updates(),
          PoseRelocalizationOptions{.codec = codec, .fail_bytes = fail_bytes});
    };
  return parts;
}

}  // namespace
}  // namespace multithread_rl

System multithread_rl_system() {
  using namespace multithread_rl;
  System system = offload_system("multithread_rl", parameter_specs());
  system.sensors = {SensorKind::kRgbd, SensorKind::kStereo};
  system.tracker = [usual = system.tracker](const Parameters& parameters) {
    check_prior_map(parameters);
    TrackerOptions options = usual(parameters);
    options.follow_recovery = keeps_recovery(parameters);
    return options;
  };
  system.mobile = [](MobileNode& node, const Parameters& parameters) {
    return std::make_unique<EdgeSlamMobile>(node, parameters, mobile_parts(parameters));
  };
  system.edge = [](EdgeNode& node, const Parameters& parameters) {
    return std::make_unique<EdgeSlamEdge>(node, parameters, edge_parts(parameters));
  };
  return system;
}

}  // namespace slambed
