// SPDX-License-Identifier: Apache-2.0
#include "multithread_rl/map_staging.hpp"

#include <algorithm>
#include <utility>

#include "offload/maps/update_content.hpp"

namespace slambed {

MapStaging::MapStaging(std::shared_ptr<Map> active, Backup backup, int recovery_keyframes)
    : backup_(backup),
      active_(std::move(active)),
      staging_(std::make_shared<Map>()),
      recovery_(recovery_keyframes) {}

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
  if (staging_->revision() > 0) staging_->clear();  // of an abandoned update
  staging_->commit(update);
  shared_ = {};
  carried_.clear();
  updated_ = keyframes_of(update);
  std::vector<KeyFrameId> uncovered;
  if (backup_ == Backup::kUncovered)
    uncovered = active_->read([](const MapView& view) { return view.keyframe_ids(); });
  std::erase_if(uncovered, [&](KeyFrameId id) { return id <= newest; });
  std::lock_guard lock(mutex_);
  std::vector<BackedKeyFrame> backed;
  for (const KeyFrameId id : uncovered)
    backed.push_back({id, std::binary_search(provisional_.begin(), provisional_.end(), id)});
  put_first(std::move(backed));
  put_first(recovery_.beside(updated_, newest));
}

void MapStaging::put_first(std::vector<BackedKeyFrame> keyframes) {
  // Keyframes made since begin() wait already and are the newest.
  std::erase_if(keyframes, [&](const BackedKeyFrame& backed) {
    return std::any_of(backlog_.begin(), backlog_.end(), [&](const BackedKeyFrame& waiting) {
      return waiting.keyframe == backed.keyframe;
    });
  });
  backlog_.insert(backlog_.begin(), keyframes.begin(), keyframes.end());
}

void MapStaging::relate() { shared_ = SharedKeyFrames(*active_, *staging_); }

std::size_t MapStaging::drain() {
  std::deque<BackedKeyFrame> backlog;
  {
    std::lock_guard lock(mutex_);
    backlog = std::exchange(backlog_, {});
  }
  std::size_t carried = 0;
  for (const BackedKeyFrame& backed : backlog) {
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
  recovery_.keyframe_created(keyframe, provisional);
  if (backup_ != Backup::kNone && phase_ != Phase::kIdle)
    backlog_.push_back({keyframe, provisional});
}

void MapStaging::recovered(KeyFrameId reference) {
  std::lock_guard lock(mutex_);
  recovery_.recovered(reference);
  if (phase_ != Phase::kIdle) backlog_.push_back({reference, false});
}

std::vector<KeyFrameId> MapStaging::provisional() const { return provisional_among(carried_); }

void MapStaging::swap() {
  std::swap(active_, staging_);
  std::lock_guard lock(mutex_);
  provisional_ = provisional();
  recovery_.applied(updated_);
}

void MapStaging::release() {
  std::lock_guard lock(mutex_);
  phase_ = Phase::kIdle;
}

}  // namespace slambed
