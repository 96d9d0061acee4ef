// SPDX-License-Identifier: Apache-2.0
#include "offload/nodes/settings.hpp"

#include "node/tracking_options.hpp"
#include "offload/nodes/original_behavior.hpp"

namespace slambed {
namespace {

UpdateApplierMaker applier(const Parameters& parameters) {
  const std::string mode = parameters.text("map_update");
  return [mode](MobileNode& node, UpdateReceiver& receiver,
                UpdateCheck& check) -> std::unique_ptr<UpdateApplier> {
    if (mode == "serial") return std::make_unique<SerialUpdates>(node, receiver, check);
    return std::make_unique<ParallelUpdates>(node, receiver, check, mode == "parallel_waiting");
  };
}

}  // namespace

System offload_system(std::string name, std::vector<ParameterSpec> specs) {
  System system;
  system.name = std::move(name);
  system.channels = {"control", "keyframe", "map", "frame"};
  system.parameters = std::move(specs);
  system.orb = orb_options;
  system.tracker = [](const Parameters& parameters) {
    const OriginalBehavior behavior = original_behavior(parameters);
    TrackerOptions options = tracker_options(parameters, behavior.tracker);
    if (behavior.max_frames > 0) {
      options.max_frames_between_keyframes = behavior.max_frames;
      options.max_frames_is_a_second = false;
    }
    // The local map is small by design, so a lost mobile relocalizes instead of starting over.
    options.reset_below_keyframes = 0;
    options.begins_lost = !edge_prior_map(parameters).empty();
    return options;
  };
  system.sequential = [](const Parameters&) { return false; };
  return system;
}

DownlinkOptions downlink_options(const Parameters& parameters, const MessageCodec& codec) {
  return {.rules = {.min_local_keyframes = parameters.integer("min_local_keyframes"),
                    .fast_motion = from_seconds(parameters.real("fast_motion_ms") / 1000),
                    .local_map_size = original_behavior(parameters).local_map_size,
                    .keyframe_rate_hz = parameters.real("decline_kf_rate_hz")},
          .codec = codec,
          .applier = applier(parameters)};
}

EdgeMappingOptions mapping_options(const Parameters& parameters, const MessageCodec& codec) {
  const OriginalBehavior behavior = original_behavior(parameters);
  return {.mapper = {.queue_limit = parameters.integer("edge_queue"),
                     .loop_closing = parameters.boolean("loop_closing"),
                     .max_frames = behavior.max_frames,
                     .mapping = {.ages_by_id = behavior.point_age_by_keyframe_id, .bundle = {}}},
          .updates = {.keyframes = parameters.integer("n_kf"),
                      .neighbors = parameters.integer("update_neighbors"),
                      .period = from_seconds(parameters.real("sync_period_s")),
                      .first = behavior.first_update_s < 0
                                   ? std::nullopt
                                   : std::optional(from_seconds(behavior.first_update_s)),
                      .poses = parameters.boolean("update_poses"),
                      .keep_recovery = false,
                      .codec = codec},
          .prior_map = edge_prior_map(parameters),
          .admission_when_idle = behavior.admission_when_idle};
}

std::string edge_prior_map(const Parameters& parameters) {
  return parameters.has("prior_map") ? parameters.text("prior_map") : std::string();
}

}  // namespace slambed
