// SPDX-License-Identifier: Apache-2.0
#include "multithread_rl/recovering_updates.hpp"

#include <algorithm>

#include "multithread_rl/keyframe_backup.hpp"
#include "offload/maps/update_content.hpp"

namespace slambed {

void RecoveringUpdates::before_frame(Worker& worker) {
  if (!suspended_) SerialUpdates::before_frame(worker);
}

void RecoveringUpdates::recovered(RunTime when, KeyFrameId reference) {
  if (keeps_recovery_) check_.recovered(when);
  recovery_ = {when, reference};
  backup_.recovered(reference);
}

std::optional<std::string_view> RecoveringUpdates::additional_decline_reason(
    const UpdateArrival& arrival) const {
  if (!recovery_ || arrival.raw.queued >= recovery_->when) return std::nullopt;
  const auto kept = keyframes_of(arrival.update.map);
  if (std::binary_search(kept.begin(), kept.end(), recovery_->reference)) return std::nullopt;
  return "from before the recovery";
}

SerialUpdates::Carried RecoveringUpdates::carry_over(Worker& worker, const UpdateArrival& arrival) {
  const wire::MapUpdate& update = arrival.update;
  const auto wanted = backup_.beside(keyframes_of(update.map), update.newest);
  if (wanted.empty()) return {};
  std::vector<BackedKeyFrame> carried;
  worker.stage("insert_keyframes", [&](StageUnits& units) {
    const Map& here = *node_.tracker().map();
    SharedKeyFrames shared(here, *arrival.map);
    for (const BackedKeyFrame& backed : wanted) {
      const MapDelta delta = slambed::carry_over(here, *arrival.map, backed.keyframe, shared);
      if (delta.keyframes.empty()) continue;
      arrival.map->commit(delta);
      carried.push_back(backed);
    }
    units.n1 = static_cast<double>(carried.size());
  });
  return {.keyframes = static_cast<int>(carried.size()), .provisional = provisional_among(carried)};
}

void RecoveringUpdates::applied(const UpdateArrival& arrival) {
  backup_.applied(keyframes_of(arrival.update.map));
}

}  // namespace slambed
