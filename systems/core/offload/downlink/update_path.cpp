// SPDX-License-Identifier: Apache-2.0
#include "offload/downlink/update_path.hpp"

namespace slambed {
namespace {

/// True, and recorded, when the update is not applied.
bool declined(Worker& worker, UpdateInbox& inbox, const UpdateArrival& arrival) {
  const auto reason = inbox.decline_reason(worker, arrival);
  if (!reason) return false;
  inbox.record_declined(arrival, *reason);
  inbox.keep_poses(worker, arrival);
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

void SerialUpdates::before_frame(Worker& worker) {
  const RunTime begin = worker.now();
  auto message = inbox_.take();
  if (!message) return;
  auto arrival = inbox_.read(worker, std::move(*message));
  if (!arrival || declined(worker, inbox_, *arrival)) return;
  if (const auto reason = further_reason(*arrival)) {
    inbox_.record_declined(*arrival, *reason);
    return inbox_.keep_poses(worker, *arrival);
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
  exchange_.done(worker, *arrival, {.begin = begin, .gap = gap, .backed_up = carried.keyframes});
}

ParallelUpdates::ParallelUpdates(MobileNode& node, UpdateInbox& inbox, UpdateExchange& exchange,
                                 bool waits)
    : node_(node),
      inbox_(inbox),
      exchange_(exchange),
      waits_(waits),
      ready_(node.runtime(), 1),
      replaced_(node.runtime()),
      disused_(node.runtime()) {}

void ParallelUpdates::start() {
  node_.runtime().spawn("map-update", [this](Worker& worker) { work(worker); });
}

void ParallelUpdates::work(Worker& worker) {
  while (!worker.stopping()) {
    const auto ticket = inbox_.signal().ticket();
    while (disused_.try_take()) {  // frees the map that an update replaced
    }
    auto message = inbox_.take();
    if (!message) {
      worker.wait(inbox_.signal(), ticket, kNever);
      continue;
    }
    working_ = true;
    auto arrival = inbox_.read(worker, std::move(*message));
    if (arrival) worker.stage("apply_update", [&](StageUnits& units) { build(*arrival, units); });
    working_ = false;
    if (!arrival) {
      ready_.signal().notify();  // for who waits for it
      continue;
    }
    if (auto replaced = ready_.put(std::move(*arrival))) {
      inbox_.record_declined(*replaced, "a newer one came");
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
  while (const auto replaced = replaced_.try_take()) inbox_.keep_poses(worker, *replaced);
  const auto arrival = ready_.try_take();
  if (!arrival || declined(worker, inbox_, *arrival)) return;
  auto old_map = node_.tracker().map();
  const int gap = gap_of(node_, *arrival);
  worker.stage("apply_update", [&](StageUnits&) { node_.replace_map(arrival->map); });
  disused_.put(std::move(old_map));
  inbox_.signal().notify();  // wakes the worker that disposes of it
  exchange_.done(worker, *arrival, {.begin = begin, .gap = gap});
}

}  // namespace slambed
