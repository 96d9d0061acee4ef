// SPDX-License-Identifier: Apache-2.0
#include "offload/edge_mapping.hpp"

#include <algorithm>

#include "features/default_vocabulary.hpp"
#include "offload/map_sync.hpp"
#include "offload/update_content.hpp"
#include "wire/message_type.hpp"

namespace slambed {
namespace {

bool same_pose(const SE3& a, const SE3& b) { return a.R == b.R && a.t == b.t; }

}  // namespace

EdgeMapping::EdgeMapping(EdgeNode& node, EdgeMappingOptions options, Channel& keyframes,
                         Channel& map)
    : node_(node),
      options_(options),
      keyframe_channel_(keyframes),
      map_channel_(map),
      places_(std::make_shared<PlaceIndex>(default_vocabulary())),
      mapping_(node.runtime(), node.log(), {}, map_, IdSpace::kEdgeMapper,
               LocalMapping::Mode::kWorker),
      received_(node.runtime().make_signal()) {
  if (options_.loop_closing) {
    loops_.emplace(node.runtime(), node.log(), LoopCloserOptions(), map_, places_, mapping_,
                   LocalMapping::Mode::kWorker);
    loops_->on_commit([this](const MapDelta& delta) { jumps_.commit(*map_, delta); });
  }
  mapping_.on_take([this](Worker&, KeyFrameId id) { return take(id); });
  mapping_.on_done([this](Worker& worker, KeyFrameId id) { mapped(worker, id); });
  mapping_.on_idle([this](Worker& worker) {
    if (loops_) loops_->idle(worker);
    return update_if_due(worker);
  });
}

void EdgeMapping::start() {
  mapping_.start();
  if (loops_) loops_->start();
  node_.runtime().spawn("receiver", [this](Worker& worker) { receive(worker); });
}

void EdgeMapping::receive(Worker& worker) {
  while (const auto message = keyframe_channel_.receive(worker, kNever)) {
    if (message->type == static_cast<std::uint8_t>(wire::MessageType::kKeyFrame)) {
      admit(worker, *message);
    }
    {
      std::lock_guard lock(mutex_);
      received_sequence_ = message->sequence;
    }
    received_->notify();
  }
}

void EdgeMapping::admit(Worker& worker, const Message& raw) {
  Pending pending;
  AdmissionState state;
  std::optional<std::string> declined;
  const bool parsed = worker.stage(options_.codec.parse_stage(), [&](StageUnits& units) {
    units.n1 = kilobytes(raw.payload);
    try {
      pending.message = options_.codec.keyframe(raw.payload, node_.peer().sensor());
    } catch (const wire::DecodeError& error) {
      node_.log().warning(std::string("KEYFRAME refused: ") + error.what());
      return false;
    }
    {
      std::lock_guard lock(mutex_);
      state.last_accepted_s = last_accepted_s_;
    }
    state = {.mapper = mapping_.status(),
             .keyframes = count(*map_).keyframes,
             .last_accepted_s = state.last_accepted_s,
             .played_fps = node_.peer().played_fps(),
             .queue_limit = options_.queue_limit};
    declined = decline_reason(pending.message, state);
    return true;
  });
  if (!parsed) return;
  const KeyFrameId id = pending.message.keyframe;
  if (declined) {
    node_.log().write(
        JsonLine("keyframe_declined").add("keyframe", id.value).add("reason", *declined));
    if (asks_ && *declined == kNoMap) {
      keyframe_channel_.send(static_cast<std::uint8_t>(wire::MessageType::kKeyFrameWanted), {});
    }
    return;
  }
  if (pending.message.first && state.last_accepted_s >= 0) begin_again(worker);
  node_.log().write(JsonLine("keyframe_received").add("keyframe", id.value));
  pending.times.captured = pending.message.captured;
  pending.times.queued = raw.queued;
  pending.times.received = raw.received;
  pending.times.accepted = worker.now();
  {
    std::lock_guard lock(mutex_);
    last_accepted_s_ = pending.message.delta.keyframes.front().timestamp_s;
    accepted_.push_back(id);
    pending_[id] = std::move(pending);
  }
  mapping_.submit(worker, id);
}

/// The mobile lost itself early and starts a new map.
void EdgeMapping::begin_again(Worker& worker) {
  mapping_.reset(worker, map_);
  map_->clear();
  jumps_.forget();
  std::lock_guard lock(mutex_);
  pending_.clear();
  accepted_.clear();
  mapped_keyframes_.clear();
  told_.clear();
  news_ = false;
}

bool EdgeMapping::take(KeyFrameId keyframe) {
  MapDelta delta;
  std::uint64_t applied = 0;
  {
    std::lock_guard lock(mutex_);
    const auto found = pending_.find(keyframe);
    if (found == pending_.end()) return false;
    delta = std::move(found->second.message.delta);
    applied = found->second.message.applied_update;
    mapping_.skip(found->second.message.newest_edge_point);
  }
  delta = map_->read([&](const MapView& view) {
    return rebase_keyframe(view, std::move(delta));
  });
  map_->commit(jumps_.follow(*map_, std::move(delta), applied));
  return true;
}

void EdgeMapping::mapped(Worker& worker, KeyFrameId keyframe) {
  {
    std::lock_guard lock(mutex_);
    const auto found = pending_.find(keyframe);
    if (found == pending_.end()) return;
    newest_times_ = found->second.times;
    newest_times_.mapped = worker.now();
    pending_.erase(found);
    mapped_keyframes_.push_back(keyframe);
    news_ = true;
  }
  if (mapped_) mapped_(worker, keyframe);
  update_if_due(worker);
  if (loops_) loops_->mapped(worker, keyframe);
}

RunTime EdgeMapping::update_if_due(Worker& worker) {
  wire::UpdateTimes times;
  KeyFrameId newest;
  {
    std::lock_guard lock(mutex_);
    if (!news_ || held_ || stopped_) return kNever;
    // The first update is due one period after the start.
    const RunTime due = std::max(last_sent_, RunTime::zero()) + options_.update_period;
    if (worker.now() < due) return due;
    times = newest_times_;
    newest = mapped_keyframes_.back();
  }
  auto keyframes = latest(options_.update_keyframes);
  if (options_.update_neighbours > 0 && !keyframes.empty()) {
    const auto around = map_->read([&](const MapView& view) {
      return with_covisibles(view, {keyframes.front()}, options_.update_neighbours);
    });
    for (const KeyFrameId id : around) {
      if (std::find(keyframes.begin(), keyframes.end(), id) == keyframes.end()) {
        keyframes.push_back(id);
      }
    }
  }
  send_update(worker, times, newest, keyframes, false);
  return kNever;
}

void EdgeMapping::send_update(Worker& worker, wire::UpdateTimes times, KeyFrameId newest,
                              const std::vector<KeyFrameId>& keyframes, bool relocalisation) {
  wire::MapUpdate update;
  update.newest = newest;
  update.settled = settled();
  update.times = times;
  update.times.due = worker.now();
  Bytes payload = worker.stage("prepare_update", [&](StageUnits& units) {
    std::uint64_t epoch = 0;
    {
      std::lock_guard lock(mutex_);
      if (stopped_) return Bytes();
      epoch = epoch_;
    }
    jumps_.update([&](std::uint64_t number) {
      update.update = number;
      update.map =
          map_->read([&](const MapView& view) { return extract_keyframes(view, keyframes); });
      if (options_.update_poses) update.poses = moved_poses(update.map);
    });
    update.map.epoch = epoch;
    units.n1 = static_cast<double>(update.map.keyframes.size());
    units.n2 = static_cast<double>(update.map.points.size());
    // Binary costs next to nothing beside collecting; text is a stage of its own.
    return update.map.keyframes.empty() || options_.codec.text() ? Bytes() : encode(update);
  });
  if (update.map.keyframes.empty()) return;
  if (options_.codec.text()) payload = options_.codec.serialise(worker, update);
  const std::size_t bytes = payload.size();
  map_channel_.send(static_cast<std::uint8_t>(relocalisation ? wire::MessageType::kRelocMap
                                                             : wire::MessageType::kMapUpdate),
                    std::move(payload));
  {
    std::lock_guard lock(mutex_);
    last_sent_ = worker.now();
    if (!relocalisation) news_ = false;
  }
  node_.log().write(JsonLine("update_sent")
                        .add("update", update.update)
                        .add("epoch", update.map.epoch)
                        .add("newest_keyframe", newest.value)
                        .add("keyframes", update.map.keyframes.size())
                        .add("points", update.map.points.size())
                        .add("bytes", bytes)
                        .add("relocalisation", relocalisation));
}

std::vector<KeyFramePose> EdgeMapping::moved_poses(const MapDelta& update) {
  std::vector<KeyFramePose> moved;
  const auto poses = all_poses();
  std::lock_guard lock(mutex_);
  for (const KeyFramePose& pose : poses) {
    const auto inside = std::any_of(update.keyframes.begin(), update.keyframes.end(),
                                    [&](const NewKeyFrame& k) { return k.id == pose.id; });
    const auto [told, fresh] = told_.try_emplace(pose.id, pose.T_cw);
    const bool changed = fresh || !same_pose(told->second, pose.T_cw);
    told->second = pose.T_cw;
    if (changed && !inside) moved.push_back(pose);
  }
  return moved;
}

std::vector<KeyFramePose> EdgeMapping::all_poses() const {
  std::vector<KeyFrameId> ids;
  {
    std::lock_guard lock(mutex_);
    ids = accepted_;
  }
  return map_->read([&](const MapView& view) {
    std::vector<KeyFramePose> poses;
    for (const KeyFrameId id : ids) {
      const KeyFrame* keyframe = view.keyframe(id);
      if (const auto pose = view.pose_of(id)) {
        poses.push_back({id, *pose, keyframe ? keyframe->version : 0});
      }
    }
    return poses;
  });
}

std::vector<KeyFrameId> EdgeMapping::latest(int count) const {
  std::vector<KeyFrameId> mapped;
  {
    std::lock_guard lock(mutex_);
    mapped = mapped_keyframes_;
  }
  return map_->read([&](const MapView& view) {
    std::vector<KeyFrameId> found;
    for (auto id = mapped.rbegin(); id != mapped.rend() && std::ssize(found) < count; ++id) {
      if (view.keyframe(*id)) found.push_back(*id);
    }
    return found;
  });
}

KeyFrameId EdgeMapping::settled() const {
  std::lock_guard lock(mutex_);
  const auto mapped = std::ssize(mapped_keyframes_);
  const auto place = mapped - 1 - LocalMapper::kGraduation;
  return place < 0 ? KeyFrameId{} : mapped_keyframes_[static_cast<std::size_t>(place)];
}

void EdgeMapping::drain(Worker& worker, std::uint64_t last_sequence, RunTime transit,
                        RunTime deadline) {
  for (;;) {
    const auto ticket = received_->ticket();
    {
      std::lock_guard lock(mutex_);
      if (received_sequence_ >= last_sequence) break;
    }
    if (worker.stopping() || worker.now() >= transit) break;
    worker.wait(*received_, ticket, transit);
  }
  mapping_.drain(worker);
  if (loops_) loops_->drain(worker, deadline);
}

RunTime EdgeMapping::last_sent() const {
  std::lock_guard lock(mutex_);
  return last_sent_;
}

void EdgeMapping::hold_updates(bool held) {
  std::lock_guard lock(mutex_);
  held_ = held;
}

void EdgeMapping::stop() {
  mapping_.park(true);
  std::lock_guard lock(mutex_);
  stopped_ = true;
}

CommitReport EdgeMapping::merge(Worker& worker, MapDelta changes) {
  mapping_.reset(worker, map_);  // parked: nobody else changes the map now
  {
    std::lock_guard lock(mutex_);
    std::erase_if(accepted_, [this](KeyFrameId id) { return pending_.contains(id); });
    pending_.clear();
  }
  changes = map_->read([&](const MapView& view) { return rebase_changes(view, changes); });
  const CommitReport report = map_->commit(changes);
  jumps_.forget();
  {
    std::lock_guard lock(mutex_);
    for (const NewKeyFrame& keyframe : changes.keyframes) {
      accepted_.push_back(keyframe.id);
      mapped_keyframes_.push_back(keyframe.id);
      last_accepted_s_ = std::max(last_accepted_s_, keyframe.timestamp_s);
    }
  }
  if (mapped_) {
    for (const NewKeyFrame& keyframe : changes.keyframes) mapped_(worker, keyframe.id);
  }
  mapping_.reset(worker, map_);  // the mapper hears which ids are taken
  return report;
}

void EdgeMapping::resume(std::uint64_t epoch) {
  {
    std::lock_guard lock(mutex_);
    stopped_ = false;
    epoch_ = epoch;
  }
  mapping_.park(false);
}

}  // namespace slambed
