// SPDX-License-Identifier: Apache-2.0
#include "offload/edge/update_sender.hpp"

#include <algorithm>

#include "node/messaging.hpp"
#include "offload/maps/update_content.hpp"
#include "wire/message_type.hpp"

namespace slambed {
namespace {

/// For this long after a recovery, the mobile's own map shows the place better than an update,
/// which is mostly about another place.
constexpr Duration kRest = std::chrono::seconds(2);

bool same_pose(const SE3& a, const SE3& b) { return a.R == b.R && a.t == b.t; }

}  // namespace

UpdateSender::UpdateSender(EdgeNode& node, EdgeMapper& mapper, UpdateSenderOptions options,
                           Channel& channel)
    : node_(node), mapper_(mapper), options_(std::move(options)), channel_(channel) {
  for (const KeyFramePose& stored : mapper.all_poses()) sent_poses_[stored.id] = {stored.T_cw, 0};
}

void UpdateSender::mapped(Worker& worker, const wire::UpdateTimes& times) {
  {
    std::lock_guard lock(mutex_);
    newest_times_ = times;
    news_ = true;
    if (recovery_ && times.captured > recovery_->found && --recovery_->to_come <= 0)
      recovery_.reset();
  }
  send_if_due(worker);
}

RunTime UpdateSender::send_if_due(Worker& worker) {
  wire::UpdateTimes times;
  KeyFrameId recovery;
  {
    std::lock_guard lock(mutex_);
    if (!news_ || suspended_ || stopped_) return kNever;
    const bool first = last_sent_ == RunTime::min();
    RunTime due = first ? RunTime::zero() + options_.first.value_or(options_.period)
                        : last_sent_ + options_.period;
    if (recovery_) due = std::max(due, recovery_->found + kRest);
    if (worker.now() < due) return due;
    times = newest_times_;
    if (recovery_) recovery = recovery_->reference;
  }
  const KeyFrameId newest = mapper_.newest();
  auto keyframes = mapper_.latest(options_.keyframes);
  if (options_.neighbors > 0 && !keyframes.empty()) {
    const auto around = mapper_.map()->read([&](const MapView& view) {
      return with_covisibles(view, {keyframes.front()}, options_.neighbors);
    });
    for (const KeyFrameId id : around) {
      if (std::find(keyframes.begin(), keyframes.end(), id) == keyframes.end()) {
        keyframes.push_back(id);
      }
    }
  }
  if (recovery && std::find(keyframes.begin(), keyframes.end(), recovery) == keyframes.end())
    keyframes.push_back(recovery);
  send(worker, times, newest, keyframes, false);
  return kNever;
}

void UpdateSender::send(Worker& worker, wire::UpdateTimes times, KeyFrameId newest,
                        const std::vector<KeyFrameId>& keyframes, bool relocalization) {
  wire::MapUpdate update;
  update.newest = newest;
  update.newest_past_probation = mapper_.newest_past_probation();
  update.times = times;
  update.times.due = worker.now();
  Bytes payload = worker.stage("prepare_update", [&](StageUnits& units) {
    std::uint64_t epoch = 0;
    {
      std::lock_guard lock(mutex_);
      if (stopped_) return Bytes();
      epoch = epoch_;
    }
    mapper_.read_for_update([&](std::uint64_t number) {
      update.update = number;
      update.map = mapper_.map()->read(
          [&](const MapView& view) { return extract_keyframes(view, keyframes); });
      if (options_.poses) update.poses = moved_poses(update);
    });
    update.map.epoch = epoch;
    units.n1 = static_cast<double>(update.map.keyframes.size());
    units.n2 = static_cast<double>(update.map.points.size());
    // Binary encoding costs little compared to collecting the map; text has its own stage.
    return update.map.keyframes.empty() || options_.codec.text() ? Bytes() : encode(update);
  });
  if (update.map.keyframes.empty()) return;
  if (options_.codec.text()) payload = options_.codec.serialize(worker, update);
  const std::size_t bytes = payload.size();
  {
    std::lock_guard lock(mutex_);
    // The state may have changed while the update was prepared.
    if (stopped_ || epoch_ != update.map.epoch || (suspended_ && !relocalization)) return;
    slambed::send(channel_, relocalization ? wire::kRelocMap : wire::kMapUpdate,
                  std::move(payload));
    last_sent_ = worker.now();
    if (!relocalization) news_ = false;
  }
  node_.log().write(JsonLine("update_sent")
                        .add("update", update.update)
                        .add("epoch", update.map.epoch)
                        .add("newest_keyframe", newest.value)
                        .add("keyframes", update.map.keyframes.size())
                        .add("points", update.map.points.size())
                        .add("bytes", bytes)
                        .add("relocalization", relocalization));
}

std::vector<KeyFramePose> UpdateSender::moved_poses(const wire::MapUpdate& update) {
  std::vector<KeyFramePose> moved;
  const auto poses = mapper_.all_poses();
  std::lock_guard lock(mutex_);
  for (const KeyFramePose& pose : poses) {
    const auto inside = std::any_of(update.map.keyframes.begin(), update.map.keyframes.end(),
                                    [&](const NewKeyFrame& k) { return k.id == pose.id; });
    const SentPose now{pose.T_cw, update.update};
    const auto [known, fresh] = sent_poses_.try_emplace(pose.id, now);
    SentPose& sent = known->second;
    if (!fresh && !same_pose(sent.T_cw, pose.T_cw)) sent = now;
    // Until the mobile confirms the update with this pose, it may have been dropped.
    if (sent.update > confirmed_ && !inside) moved.push_back(pose);
  }
  return moved;
}

void UpdateSender::suspend(RunTime asked) {
  std::lock_guard lock(mutex_);
  suspended_ = asked;
}

void UpdateSender::recovered(RunTime found, KeyFrameId reference) {
  std::lock_guard lock(mutex_);
  suspended_.reset();
  if (options_.keep_recovery && reference)
    recovery_ = Recovery{.reference = reference, .found = found, .to_come = options_.keyframes};
}

void UpdateSender::keyframe_received(const wire::KeyFrameMessage& keyframe) {
  std::lock_guard lock(mutex_);
  if (suspended_ && keyframe.captured >= *suspended_) suspended_.reset();
  confirmed_ = std::max(confirmed_, keyframe.applied_update);
}

void UpdateSender::stop() {
  std::lock_guard lock(mutex_);
  stopped_ = true;
}

void UpdateSender::resume(std::uint64_t epoch) {
  std::lock_guard lock(mutex_);
  stopped_ = false;
  epoch_ = epoch;
}

void UpdateSender::clear() {
  std::lock_guard lock(mutex_);
  sent_poses_.clear();
  recovery_.reset();
  news_ = false;
}

}  // namespace slambed
