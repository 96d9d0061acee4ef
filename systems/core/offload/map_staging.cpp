// SPDX-License-Identifier: Apache-2.0
#include "offload/map_staging.hpp"

#include <algorithm>
#include <utility>

namespace slambed {

MapStaging::MapStaging(std::shared_ptr<Map> active, Backup backup)
    : backup_(backup), active_(std::move(active)), staging_(std::make_shared<Map>()) {}

bool MapStaging::idle() const {
  std::lock_guard lock(mutex_);
  return phase_ == Phase::kIdle;
}

void MapStaging::begin() {
  std::lock_guard lock(mutex_);
  phase_ = Phase::kUpdating;
}

void MapStaging::cancel() {
  std::lock_guard lock(mutex_);
  phase_ = Phase::kIdle;
  backlog_.clear();
}

void MapStaging::insert(const MapDelta& update, KeyFrameId newest) {
  if (staging_->revision() > 0) staging_->clear();  // of an update that was given up
  staging_->commit(update);
  shared_ = {};
  carried_.clear();
  if (backup_ != Backup::kUncovered) return;
  auto uncovered = active_->read([](const MapView& view) { return view.keyframe_ids(); });
  std::erase_if(uncovered, [&](KeyFrameId id) { return id <= newest; });
  std::lock_guard lock(mutex_);
  // Those made since the begin wait already, and are the newest.
  std::erase_if(uncovered, [&](KeyFrameId id) {
    return std::any_of(backlog_.begin(), backlog_.end(),
                       [&](const Backed& backed) { return backed.keyframe == id; });
  });
  for (auto id = uncovered.rbegin(); id != uncovered.rend(); ++id) {
    backlog_.push_front({*id, std::binary_search(provisional_.begin(), provisional_.end(), *id)});
  }
}

void MapStaging::relate() { shared_ = SharedKeyFrames(*active_, *staging_); }

std::size_t MapStaging::drain() {
  std::deque<Backed> backlog;
  {
    std::lock_guard lock(mutex_);
    backlog = std::exchange(backlog_, {});
  }
  std::size_t carried = 0;
  for (const Backed& backed : backlog) {
    const MapDelta delta = carry_over(*active_, *staging_, backed.keyframe, shared_);
    if (delta.keyframes.empty()) continue;
    staging_->commit(delta);
    carried_.push_back(backed);
    ++carried;
  }
  return carried;
}

std::size_t MapStaging::waiting() const {
  std::lock_guard lock(mutex_);
  return backlog_.size();
}

void MapStaging::set_ready() {
  std::lock_guard lock(mutex_);
  phase_ = Phase::kReady;
}

bool MapStaging::ready() const {
  std::lock_guard lock(mutex_);
  return phase_ == Phase::kReady;
}

void MapStaging::keyframe_created(KeyFrameId keyframe, bool provisional) {
  std::lock_guard lock(mutex_);
  if (provisional) provisional_.push_back(keyframe);
  if (backup_ != Backup::kNone && phase_ != Phase::kIdle)
    backlog_.push_back({keyframe, provisional});
}

void MapStaging::back_up(KeyFrameId keyframe) {
  std::lock_guard lock(mutex_);
  if (phase_ != Phase::kIdle) backlog_.push_back({keyframe, false});
}

std::vector<KeyFrameId> MapStaging::provisional() const {
  std::vector<KeyFrameId> ids;
  for (const Backed& backed : carried_) {
    if (backed.provisional) ids.push_back(backed.keyframe);
  }
  std::sort(ids.begin(), ids.end());
  return ids;
}

void MapStaging::swap() {
  std::swap(active_, staging_);
  std::lock_guard lock(mutex_);
  provisional_ = provisional();
}

void MapStaging::release() {
  std::lock_guard lock(mutex_);
  phase_ = Phase::kIdle;
}

}  // namespace slambed
