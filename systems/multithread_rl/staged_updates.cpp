// SPDX-License-Identifier: Apache-2.0
#include "multithread_rl/staged_updates.hpp"

#include <utility>

namespace slambed {
namespace {

/// Most rounds in which the worker carries over keyframes made meanwhile; tracking does the rest.
constexpr int kRounds = 8;

}  // namespace

StagedUpdates::StagedUpdates(MobileNode& node, UpdateReceiver& receiver, UpdateCheck& check,
                             MapStaging::Backup backup, int recovery_keyframes)
    : UpdateApplier(node, receiver, check),
      keeps_recovery_(recovery_keyframes > 0),
      staging_(node.tracker().map(), backup, recovery_keyframes),
      prepared_(node.runtime()),
      declined_(node.runtime()) {}

void StagedUpdates::start() {
  node_.runtime().spawn("map-update", [this](Worker& worker) { work(worker); });
}

void StagedUpdates::work(Worker& worker) {
  while (!worker.stopping()) {
    const auto ticket = receiver_.signal().ticket();
    // While one is prepared, the newest of the others waits in the channel.
    auto message = staging_.idle() && !suspended_ ? receiver_.take() : std::nullopt;
    if (message) {
      prepare(worker, std::move(*message));
    } else {
      worker.wait(receiver_.signal(), ticket, kNever);
    }
  }
}

void StagedUpdates::prepare(Worker& worker, Message message) {
  staging_.begin();
  auto arrival = receiver_.read(worker, std::move(message));
  if (!arrival) return staging_.cancel();
  if (const auto reason = check_.update_decline_reason(worker, *arrival)) {
    staging_.cancel();
    check_.record_declined(*arrival, *reason);
    declined_.put(std::move(*arrival));
    return;
  }
  node_.log().write(JsonLine("update_begun")
                        .add("update", arrival->update.update)
                        .add("relocalization", arrival->relocalization()));
  worker.stage("insert_keyframes", [&](StageUnits& units) {
    staging_.insert(arrival->update.map, arrival->update.newest);
    units.n1 = static_cast<double>(arrival->update.map.keyframes.size());
    units.n2 = static_cast<double>(arrival->update.map.points.size());
  });
  worker.stage("update_reference", [&](StageUnits& units) {
    staging_.relate();
    units.n1 = static_cast<double>(arrival->update.map.keyframes.size());
  });
  catch_up(worker);
  node_.log().write(JsonLine("update_ready")
                        .add("update", arrival->update.update)
                        .add("backed_up", staging_.carried()));
  prepared_.put(std::move(*arrival));
  staging_.set_ready();
}

void StagedUpdates::suspend(bool suspended) {
  suspended_ = suspended;
  if (!suspended) receiver_.signal().notify();
}

void StagedUpdates::recovered(RunTime when, KeyFrameId reference) {
  if (keeps_recovery_) check_.recovered(when);
  staging_.recovered(reference);
}

void StagedUpdates::catch_up(Worker& worker) {
  // If keyframes were made faster than they are carried over, this would not end, and the map would
  // get outdated. What the rounds leave is carried over at the swap.
  const std::size_t first = staging_.waiting();
  for (int round = 0; round < kRounds && !worker.stopping(); ++round) {
    const std::size_t waiting = staging_.waiting();
    if (waiting == 0 || waiting > first) return;
    insert_backlog(worker);
  }
}

void StagedUpdates::insert_backlog(Worker& worker) {
  worker.stage("insert_keyframes",
               [&](StageUnits& units) { units.n1 = static_cast<double>(staging_.drain()); });
}

void StagedUpdates::before_frame(Worker& worker) {
  while (const auto update = declined_.try_take()) check_.keep_poses(worker, *update);
  if (!staging_.ready()) return;
  if (suspended_) {
    waited_ = true;
    return;
  }
  auto arrival = prepared_.try_take();
  if (!arrival) return;
  // It passed the rules when preparation began. Since then the camera may have been relocalized, or
  // a new edge or epoch may have begun.
  const bool anew = arrival->relocalization() || std::exchange(waited_, false);
  const auto reason = anew ? check_.update_decline_reason(worker, *arrival)
                           : check_.obsolete_reason(worker, *arrival);
  if (!reason) return exchange_maps(worker, std::move(*arrival));
  check_.record_declined(*arrival, *reason);
  check_.keep_poses(worker, *arrival);
  staging_.cancel();
  receiver_.signal().notify();
}

void StagedUpdates::exchange_maps(Worker& worker, UpdateArrival arrival) {
  const RunTime begin = worker.now();
  if (staging_.waiting() > 0) insert_backlog(worker);
  const auto kept =
      staging_.staging()->read([](const MapView& view) { return view.keyframe_ids(); });
  const int gap = local_map_gap(*staging_.active(), arrival.update.newest, kept);
  worker.stage("update_last_frame", [&](StageUnits& units) {
    node_.replace_map(staging_.staging(), staging_.provisional());
    staging_.swap();
    units.n1 = static_cast<double>(kept.size());
  });
  const auto backed_up = static_cast<int>(staging_.carried());
  worker.stage("clean_map", [&](StageUnits& units) {
    units.n1 = static_cast<double>(count(*staging_.staging()).keyframes);
    staging_.clean();
  });
  staging_.release();
  receiver_.signal().notify();
  arrival.map = staging_.active();
  done(worker, arrival, {.begin = begin, .gap = gap, .backed_up = backed_up});
}

}  // namespace slambed
