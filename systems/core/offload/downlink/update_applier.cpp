// SPDX-License-Identifier: Apache-2.0
#include "offload/downlink/update_applier.hpp"

#include <algorithm>

namespace slambed {
namespace {

/// Returns whether the rules decline the update; if so, logs the reason and keeps its poses.
bool declined(Worker& worker, UpdateCheck& check, const UpdateArrival& arrival) {
  const auto reason = check.update_decline_reason(worker, arrival);
  if (!reason) return false;
  check.record_declined(arrival, *reason);
  check.keep_poses(worker, arrival);
  return true;
}

void build(UpdateArrival& arrival, StageUnits& units) {
  arrival.map = std::make_shared<Map>();
  arrival.map->commit(arrival.update.map);
  units.n1 = static_cast<double>(arrival.update.map.keyframes.size());
  units.n2 = static_cast<double>(arrival.update.map.points.size());
}

int gap_of(MobileNode& node, const UpdateArrival& arrival) {
  const auto kept = arrival.map->read([](const MapView& view) { return view.keyframe_ids(); });
  return local_map_gap(*node.tracker().map(), arrival.update.newest, kept);
}

}  // namespace

int local_map_gap(const Map& old_map, KeyFrameId newest, std::span<const KeyFrameId> kept) {
  return old_map.read([&](const MapView& view) {
    int gap = 0;
    for (const KeyFrameId id : view.keyframe_ids()) {
      gap += id > newest && !std::binary_search(kept.begin(), kept.end(), id) ? 1 : 0;
    }
    return gap;
  });
}

void UpdateApplier::done(Worker& worker, const UpdateArrival& arrival, const Outcome& outcome) {
  check_.applied(arrival, outcome.backed_up > 0);
  from_map_ = arrival.relocalization();
  if (on_applied_) on_applied_(arrival.update, arrival.map);
  check_.place_keyframes(arrival.update);

  // Each part begins at the timestamp where the previous one ends, so they add up to the total.
  const wire::UpdateTimes& times = arrival.update.times;
  const RunTime now = worker.now();
  JsonLine event("update_applied");
  event.add("update", arrival.update.update)
      .add("newest_keyframe", arrival.update.newest.value)
      .add("keyframes", arrival.update.map.keyframes.size())
      .add("points", arrival.update.map.points.size())
      .add("relocalization", arrival.relocalization())
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

void SerialUpdates::before_frame(Worker& worker) {
  const RunTime begin = worker.now();
  auto message = receiver_.take();
  if (!message) return;
  auto arrival = receiver_.read(worker, std::move(*message));
  if (!arrival || declined(worker, check_, *arrival)) return;
  if (const auto reason = additional_decline_reason(*arrival)) {
    check_.record_declined(*arrival, *reason);
    return check_.keep_poses(worker, *arrival);
  }
  worker.stage("insert_keyframes", [&](StageUnits& units) { build(*arrival, units); });
  const Carried carried = carry_over(worker, *arrival);
  const double keyframes = static_cast<double>(arrival->update.map.keyframes.size());
  const int gap = worker.stage("update_reference", [&](StageUnits& units) {
    units.n1 = keyframes;
    return gap_of(node_, *arrival);
  });
  auto old_map = node_.tracker().map();
  worker.stage("update_last_frame", [&](StageUnits& units) {
    units.n1 = keyframes;
    node_.replace_map(arrival->map, carried.provisional);
  });
  applied(*arrival);
  worker.stage("clean_map", [&](StageUnits& units) {
    units.n1 = static_cast<double>(count(*old_map).keyframes);
    old_map.reset();
  });
  done(worker, *arrival, {.begin = begin, .gap = gap, .backed_up = carried.keyframes});
}

ParallelUpdates::ParallelUpdates(MobileNode& node, UpdateReceiver& receiver, UpdateCheck& check,
                                 bool waits)
    : UpdateApplier(node, receiver, check),
      waits_(waits),
      ready_(node.runtime(), 1),
      replaced_(node.runtime()),
      disused_(node.runtime()) {}

void ParallelUpdates::start() {
  node_.runtime().spawn("map-update", [this](Worker& worker) { work(worker); });
}

void ParallelUpdates::work(Worker& worker) {
  while (!worker.stopping()) {
    const auto ticket = receiver_.signal().ticket();
    while (disused_.try_take()) {  // frees the map that an update replaced
    }
    auto message = receiver_.take();
    if (!message) {
      worker.wait(receiver_.signal(), ticket, kNever);
      continue;
    }
    working_ = true;
    auto arrival = receiver_.read(worker, std::move(*message));
    if (arrival) worker.stage("apply_update", [&](StageUnits& units) { build(*arrival, units); });
    working_ = false;
    if (!arrival) {
      ready_.signal().notify();  // wakes tracking if it waits for this update
      continue;
    }
    if (auto replaced = ready_.put(std::move(*arrival))) {
      check_.record_declined(*replaced, "a newer one came");
      replaced_.put(std::move(*replaced));
    }
  }
}

void ParallelUpdates::before_frame(Worker& worker) {
  const RunTime begin = worker.now();
  while (waits_ && !worker.stopping()) {
    const auto ticket = ready_.signal().ticket();
    if (!working_) break;
    worker.wait(ready_.signal(), ticket, kNever);
  }
  while (const auto replaced = replaced_.try_take()) check_.keep_poses(worker, *replaced);
  const auto arrival = ready_.try_take();
  if (!arrival || declined(worker, check_, *arrival)) return;
  auto old_map = node_.tracker().map();
  const int gap = gap_of(node_, *arrival);
  worker.stage("apply_update", [&](StageUnits&) { node_.replace_map(arrival->map); });
  disused_.put(std::move(old_map));
  receiver_.signal().notify();  // wakes the worker, which frees the old map
  done(worker, *arrival, {.begin = begin, .gap = gap});
}

}  // namespace slambed
