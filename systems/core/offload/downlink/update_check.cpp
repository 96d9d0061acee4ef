// SPDX-License-Identifier: Apache-2.0
#include "offload/downlink/update_check.hpp"

#include <algorithm>

namespace slambed {
namespace {

bool made_by_edge(MapPointId id) { return space_of(id) == IdSpace::kEdgeMapper; }

}  // namespace

UpdateState UpdateCheck::state_for(Worker& worker, const UpdateArrival& arrival) const {
  const PeerState edge = node_.network().peer();
  std::lock_guard lock(mutex_);
  const auto local_map = local_map_.lock();
  return {.relocalization = arrival.relocalization(),
          .lost = lost_,
          .former_edge = arrival.raw.session != edge.session,
          .before_recovery = arrival.raw.queued < recovered_,
          .older_than_deferred_keyframes = arrival.update.newest < expected_,
          .update = arrival.update.update,
          .applied = knows(edge) ? applied_ : 0,
          .epoch = arrival.update.map.epoch,
          .current_epoch = epoch_,
          .local_keyframes = local_map ? count(*local_map).keyframes : 0,
          .new_keyframe = new_keyframe_,
          .since_keyframe = worker.now() - last_keyframe_,
          .keyframes_in_window = keyframes_since(worker.now() - kRateWindow)};
}

std::optional<std::string_view> UpdateCheck::update_decline_reason(
    Worker& worker, const UpdateArrival& arrival) const {
  return slambed::update_decline_reason(rules_, state_for(worker, arrival));
}

std::optional<std::string_view> UpdateCheck::obsolete_reason(Worker& worker,
                                                             const UpdateArrival& arrival) const {
  return slambed::obsolete_reason(state_for(worker, arrival));
}

void UpdateCheck::record_declined(const UpdateArrival& arrival, std::string_view reason) {
  node_.log().write(JsonLine("update_declined")
                        .add("update", arrival.update.update)
                        .add("newest_keyframe", arrival.update.newest.value)
                        .add("reason", reason));
}

void UpdateCheck::look() {
  std::lock_guard lock(mutex_);
  lost_ = node_.tracker().state() == TrackingState::kLost;
  local_map_ = node_.tracker().map();
}

void UpdateCheck::keep_poses(Worker& worker, const UpdateArrival& arrival) {
  if (keeps_poses(state_for(worker, arrival))) place_keyframes(arrival.update);
}

void UpdateCheck::place_keyframes(const wire::MapUpdate& update) {
  for (const NewKeyFrame& keyframe : update.map.keyframes)
    node_.poses().placed(keyframe.id, keyframe.T_cw);
  for (const KeyFramePose& pose : update.poses) node_.poses().placed(pose.id, pose.T_cw);
}

void UpdateCheck::keyframe_created(RunTime when) {
  std::lock_guard lock(mutex_);
  recent_keyframes_.push_back(when);
  while (recent_keyframes_.front() + kRateWindow < when) recent_keyframes_.pop_front();
  new_keyframe_ = true;
  last_keyframe_ = when;
}

void UpdateCheck::applied(const UpdateArrival& arrival, bool newer) {
  std::lock_guard lock(mutex_);
  applied_ = arrival.update.update;
  newest_past_probation_ = arrival.update.newest_past_probation;
  applied_session_ = arrival.raw.session;
  note_edge_points(arrival.update.map);
  new_keyframe_ = newer;
}

void UpdateCheck::note_edge_points(const MapDelta& map) {
  for (const NewPoint& point : map.points) {
    if (made_by_edge(point.id)) newest_edge_point_ = std::max(newest_edge_point_, point.id);
  }
}

void UpdateCheck::joined(const MapDelta& keyframe, std::uint64_t update, std::uint64_t session) {
  std::lock_guard lock(mutex_);
  if (applied_session_ != session) newest_past_probation_ = {};  // it belonged to the former edge
  applied_ = update;
  applied_session_ = session;
  note_edge_points(keyframe);
}

void UpdateCheck::begin_epoch(std::uint64_t epoch) {
  std::lock_guard lock(mutex_);
  epoch_ = epoch;
  applied_ = 0;
}

void UpdateCheck::expect_keyframe(KeyFrameId keyframe) {
  std::lock_guard lock(mutex_);
  expected_ = keyframe;
}

void UpdateCheck::recovered(RunTime when) {
  std::lock_guard lock(mutex_);
  recovered_ = when;
}

std::uint64_t UpdateCheck::applied_update() const {
  const PeerState edge = node_.network().peer();
  std::lock_guard lock(mutex_);
  return knows(edge) ? applied_ : 0;
}

MapPointId UpdateCheck::newest_edge_point() const {
  std::lock_guard lock(mutex_);
  return newest_edge_point_;
}

KeyFrameId UpdateCheck::newest_past_probation() const {
  const PeerState edge = node_.network().peer();
  std::lock_guard lock(mutex_);
  return knows(edge) ? newest_past_probation_ : KeyFrameId{};
}

int UpdateCheck::keyframes_since(RunTime begin) const {
  return static_cast<int>(std::count_if(recent_keyframes_.begin(), recent_keyframes_.end(),
                                        [&](RunTime created) { return created > begin; }));
}

}  // namespace slambed
