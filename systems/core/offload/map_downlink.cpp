// SPDX-License-Identifier: Apache-2.0
#include "offload/map_downlink.hpp"

#include <algorithm>

#include "wire/message_type.hpp"

namespace slambed {
namespace {

bool is_relocalisation(const Message& message) {
  return message.type == static_cast<std::uint8_t>(wire::MessageType::kRelocMap);
}

bool is_update(const Message& message) {
  return is_relocalisation(message) ||
         message.type == static_cast<std::uint8_t>(wire::MessageType::kMapUpdate);
}

/// Keyframes of the old map that are newer than the update and not in it: lost to tracking.
int local_map_gap(const Map& old_map, const wire::MapUpdate& update) {
  const auto& kept = update.map.keyframes;
  return old_map.read([&](const MapView& view) {
    int gap = 0;
    for (const KeyFrameId id : view.keyframe_ids()) {
      const bool stays = std::any_of(
          kept.begin(), kept.end(), [&](const NewKeyFrame& keyframe) { return keyframe.id == id; });
      gap += id > update.newest && !stays ? 1 : 0;
    }
    return gap;
  });
}

bool made_by_edge(MapPointId id) {
  constexpr int kSpaceShift = 56;  // IdSpace is the top byte
  return id.value >> kSpaceShift == static_cast<std::uint64_t>(IdSpace::kEdgeMapper);
}

}  // namespace

MapDownlink::MapDownlink(MobileNode& node, Channel& channel, Mode mode, UpdateRules rules,
                         MessageCodec codec)
    : node_(node),
      channel_(channel),
      mode_(mode),
      rules_(rules),
      codec_(std::move(codec)),
      ready_(node.runtime(), 1),
      replaced_(node.runtime()),
      disused_(node.runtime()) {}

void MapDownlink::start() {
  if (mode_ == Mode::kParallel) {
    node_.runtime().spawn("map-update", [this](Worker& worker) { work(worker); });
  }
}

void MapDownlink::work(Worker& worker) {
  while (!worker.stopping()) {
    const auto ticket = channel_.signal().ticket();
    while (disused_.try_take()) {  // frees the map that an update replaced
    }
    auto message = channel_.try_receive();
    if (!message) {
      worker.wait(channel_.signal(), ticket, kNever);
      continue;
    }
    if (!is_update(*message)) continue;
    Arrival arrival{.raw = std::move(*message), .update = {}, .map = nullptr};
    if (!parse(worker, arrival)) continue;
    worker.stage("apply_update", [&](StageUnits& units) {
      build(arrival);
      units.n1 = static_cast<double>(arrival.update.map.keyframes.size());
      units.n2 = static_cast<double>(arrival.update.map.points.size());
    });
    if (auto replaced = ready_.put(std::move(arrival))) {
      record_declined(replaced->update.update, replaced->update.newest, "a newer one came");
      replaced_.put(std::move(*replaced));
    }
  }
}

void MapDownlink::before_frame(Worker& worker) {
  const RunTime begin = worker.now();
  if (mode_ == Mode::kParallel) {
    while (const auto replaced = replaced_.try_take()) {
      if (tells_poses(state_for(worker, *replaced))) place_keyframes(replaced->update);
    }
    auto arrival = ready_.try_take();
    if (!arrival || declined(worker, *arrival)) return;
    apply(worker, std::move(*arrival), begin);
    return;
  }
  auto message = channel_.try_receive();
  if (!message || !is_update(*message)) return;
  Arrival arrival{.raw = std::move(*message), .update = {}, .map = nullptr};
  if (!parse(worker, arrival) || declined(worker, arrival)) return;
  apply(worker, std::move(arrival), begin);
}

bool MapDownlink::parse(Worker& worker, Arrival& arrival) {
  const bool good = worker.stage(codec_.parse_stage(), [&](StageUnits& units) {
    units.n1 = kilobytes(arrival.raw.payload);
    try {
      arrival.update = codec_.update(arrival.raw.payload, node_.sensor());
    } catch (const wire::DecodeError& error) {
      node_.log().warning(std::string("MAP_UPDATE refused: ") + error.what());
      return false;
    }
    arrival.raw.payload = {};
    return true;
  });
  if (good) record_received(arrival);
  return good;
}

void MapDownlink::build(Arrival& arrival) {
  arrival.map = std::make_shared<Map>();
  arrival.map->commit(arrival.update.map);
}

UpdateState MapDownlink::state_for(Worker& worker, const Arrival& arrival) const {
  const PeerState edge = node_.network().peer();
  return {.relocalisation = is_relocalisation(arrival.raw),
          .lost = node_.tracker().state() == TrackingState::kLost,
          .former_edge = arrival.raw.incarnation != edge.incarnation,
          .behind = arrival.update.newest < expected_,
          .update = arrival.update.update,
          .applied = knows(edge) ? applied_ : 0,
          .epoch = arrival.update.map.epoch,
          .current_epoch = epoch_,
          .local_keyframes = count(*node_.tracker().map()).keyframes,
          .keyframes_created = keyframes_created_,
          .new_keyframe = new_keyframe_,
          .since_keyframe = worker.now() - last_keyframe_,
          .keyframes_in_window = keyframes_since(worker.now() - kRateWindow)};
}

bool MapDownlink::declined(Worker& worker, const Arrival& arrival) {
  const UpdateState state = state_for(worker, arrival);
  const auto reason = decline_reason(rules_, state);
  if (!reason) return false;
  record_declined(arrival.update.update, arrival.update.newest, *reason);
  // The edge may be gone before it tells them again.
  if (tells_poses(state)) place_keyframes(arrival.update);
  return true;
}

void MapDownlink::place_keyframes(const wire::MapUpdate& update) {
  for (const NewKeyFrame& keyframe : update.map.keyframes)
    node_.poses().placed(keyframe.id, keyframe.T_cw);
  for (const KeyFramePose& pose : update.poses) node_.poses().placed(pose.id, pose.T_cw);
}

void MapDownlink::apply(Worker& worker, Arrival arrival, RunTime begin) {
  auto old_map = node_.tracker().map();
  const int gap = local_map_gap(*old_map, arrival.update);
  worker.stage("apply_update", [&](StageUnits& units) {
    if (!arrival.map) {
      build(arrival);
      units.n1 = static_cast<double>(arrival.update.map.keyframes.size());
      units.n2 = static_cast<double>(arrival.update.map.points.size());
    }
    node_.replace_map(arrival.map);
    if (mode_ == Mode::kSerial) old_map.reset();
  });
  if (old_map) {
    disused_.put(std::move(old_map));
    channel_.signal().notify();  // wakes the worker that disposes of it
  }
  applied_ = arrival.update.update;
  settled_ = arrival.update.settled;
  applied_incarnation_ = arrival.raw.incarnation;
  for (const NewPoint& point : arrival.update.map.points) {
    if (made_by_edge(point.id)) {
      newest_edge_point_ = std::max(newest_edge_point_, point.id);
    }
  }
  new_keyframe_ = false;
  if (on_applied_) on_applied_(arrival.update, arrival.map);
  place_keyframes(arrival.update);

  // Consecutive stamps: the parts add up to the total by construction.
  const wire::UpdateTimes& times = arrival.update.times;
  const RunTime now = worker.now();
  node_.log().write(JsonLine("update_applied")
                        .add("update", arrival.update.update)
                        .add("newest_keyframe", arrival.update.newest.value)
                        .add("keyframes", arrival.update.map.keyframes.size())
                        .add("points", arrival.update.map.points.size())
                        .add("relocalisation", is_relocalisation(arrival.raw))
                        .add("gap_keyframes", gap)
                        .add_ms("pause_ms", now - begin)
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

int MapDownlink::keyframes_since(RunTime begin) const {
  return static_cast<int>(
      std::count_if(recent_keyframes_.begin(), recent_keyframes_.end(),
                    [&](RunTime created) { return created > begin; }));
}

void MapDownlink::keyframe_created(RunTime when) {
  recent_keyframes_.push_back(when);
  while (recent_keyframes_.front() + kRateWindow < when) recent_keyframes_.pop_front();
  ++keyframes_created_;
  new_keyframe_ = true;
  last_keyframe_ = when;
}

void MapDownlink::record_received(const Arrival& arrival) {
  node_.log().write(JsonLine("update_received")
                        .add("update", arrival.update.update)
                        .add("newest_keyframe", arrival.update.newest.value)
                        .add("keyframes", arrival.update.map.keyframes.size())
                        .add("points", arrival.update.map.points.size()));
}

void MapDownlink::record_declined(std::uint64_t update, KeyFrameId newest,
                                  std::string_view reason) {
  node_.log().write(JsonLine("update_declined")
                        .add("update", update)
                        .add("newest_keyframe", newest.value)
                        .add("reason", reason));
}

}  // namespace slambed
