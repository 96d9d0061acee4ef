// SPDX-License-Identifier: Apache-2.0
#include "offload/downlink/update_exchange.hpp"

#include <algorithm>

namespace slambed {

int local_map_gap(const Map& old_map, KeyFrameId newest, std::span<const KeyFrameId> kept) {
  return old_map.read([&](const MapView& view) {
    int gap = 0;
    for (const KeyFrameId id : view.keyframe_ids()) {
      gap += id > newest && !std::binary_search(kept.begin(), kept.end(), id) ? 1 : 0;
    }
    return gap;
  });
}

void UpdateExchange::done(Worker& worker, const UpdateArrival& arrival, const Outcome& outcome) {
  inbox_.applied(arrival, outcome.backed_up > 0);
  from_map_ = arrival.relocalisation();
  if (on_applied_) on_applied_(arrival.update, arrival.map);
  inbox_.place_keyframes(arrival.update);

  // Consecutive stamps: the parts add up to the total by construction.
  const wire::UpdateTimes& times = arrival.update.times;
  const RunTime now = worker.now();
  JsonLine event("update_applied");
  event.add("update", arrival.update.update)
      .add("newest_keyframe", arrival.update.newest.value)
      .add("keyframes", arrival.update.map.keyframes.size())
      .add("points", arrival.update.map.points.size())
      .add("relocalisation", arrival.relocalisation())
      .add("gap_keyframes", outcome.gap);
  if (outcome.backed_up > 0) event.add("backed_up", outcome.backed_up);
  node_.log().write(event.add_ms("pause_ms", now - outcome.begin)
                        .add_ms("t_track_ms", times.queued - times.captured)
                        .add_ms("t_me_ms", times.received - times.queued)
                        .add_ms("t_rkf_ms", times.accepted - times.received)
                        .add_ms("t_lm_ms", times.mapped - times.accepted)
                        .add_ms("t_wait_ms", times.due - times.mapped)
                        .add_ms("t_plmu_ms", arrival.raw.queued - times.due)
                        .add_ms("t_em_ms", arrival.raw.received - arrival.raw.queued)
                        .add_ms("t_mu_ms", now - arrival.raw.received)
                        .add_ms("t_total_ms", now - times.captured));
}

}  // namespace slambed
