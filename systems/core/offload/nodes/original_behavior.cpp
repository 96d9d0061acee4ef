// SPDX-License-Identifier: Apache-2.0
#include "offload/nodes/original_behavior.hpp"

namespace slambed {

OriginalBehaviour original_behaviour(const Parameters& parameters) {
  OriginalBehaviour behaviour;
  if (!parameters.has("reference_fallback")) return behaviour;
  behaviour.local_map_size = parameters.integer("local_map_size");
  behaviour.max_frames = parameters.integer("max_frames");
  behaviour.admission_when_idle = parameters.text("admission") == "when_idle";
  behaviour.culls_by_id = parameters.text("cull_age") == "keyframe_ids";
  behaviour.updates_after_extraction = parameters.text("update_poll") == "after_extraction";
  behaviour.first_update_s = parameters.real("first_update_s");
  behaviour.tracker.descriptor_fallback = parameters.text("reference_fallback") == "descriptors";
  behaviour.tracker.points_by_observation = parameters.text("point_identity") == "observations";
  behaviour.tracker.points_by_rank = parameters.text("last_frame_points") == "by_rank";
  behaviour.tracker.newest_is_reference = parameters.text("reference_after_update") == "newest";
  behaviour.tracker.reanchor_last = parameters.boolean("reanchor_last");
  behaviour.tracker.observes_known = parameters.boolean("local_observations");
  return behaviour;
}

}  // namespace slambed
