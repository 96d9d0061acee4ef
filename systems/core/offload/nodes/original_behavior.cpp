// SPDX-License-Identifier: Apache-2.0
#include "offload/nodes/original_behavior.hpp"

namespace slambed {

OriginalBehavior original_behavior(const Parameters& parameters) {
  OriginalBehavior behavior;
  if (!parameters.has("reference_fallback")) return behavior;
  behavior.local_map_size = parameters.integer("local_map_size");
  behavior.max_frames = parameters.integer("max_frames");
  behavior.admission_when_idle = parameters.text("admission") == "when_idle";
  behavior.point_age_by_keyframe_id = parameters.text("cull_age") == "keyframe_ids";
  behavior.updates_after_extraction = parameters.text("update_poll") == "after_extraction";
  behavior.first_update_s = parameters.real("first_update_s");
  behavior.tracker.descriptor_fallback = parameters.text("reference_fallback") == "descriptors";
  behavior.tracker.points_by_observation = parameters.text("point_identity") == "observations";
  behavior.tracker.points_by_rank = parameters.text("last_frame_points") == "by_rank";
  behavior.tracker.newest_is_reference = parameters.text("reference_after_update") == "newest";
  behavior.tracker.reanchor_last = parameters.boolean("reanchor_last");
  behavior.tracker.observes_known = parameters.boolean("local_observations");
  return behavior;
}

}  // namespace slambed
