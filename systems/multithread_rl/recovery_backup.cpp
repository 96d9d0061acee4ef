// SPDX-License-Identifier: Apache-2.0
#include "multithread_rl/recovery_backup.hpp"

#include <algorithm>

namespace slambed {

std::vector<KeyFrameId> provisional_among(std::span<const BackedKeyFrame> backed) {
  std::vector<KeyFrameId> ids;
  for (const BackedKeyFrame& keyframe : backed) {
    if (keyframe.provisional) ids.push_back(keyframe.keyframe);
  }
  std::sort(ids.begin(), ids.end());
  return ids;
}

void RecoveryBackup::recovered(KeyFrameId reference) {
  made_.clear();
  reference_ = wanted_ > 0 ? reference : KeyFrameId{};
}

void RecoveryBackup::keyframe_created(KeyFrameId keyframe, bool provisional) {
  if (reference_) made_.push_back({keyframe, provisional});
}

bool RecoveryBackup::is_over(std::span<const KeyFrameId> updated) const {
  if (made_.empty()) return false;
  const KeyFrameId first = made_.front().keyframe;
  return std::count_if(updated.begin(), updated.end(),
                       [&](KeyFrameId id) { return id >= first; }) >= wanted_;
}

std::vector<BackedKeyFrame> RecoveryBackup::beside(std::span<const KeyFrameId> updated,
                                                   KeyFrameId newest) const {
  if (!reference_ || is_over(updated)) return {};
  std::vector<BackedKeyFrame> kept;
  if (std::find(updated.begin(), updated.end(), reference_) == updated.end())
    kept.push_back({reference_, false});
  // Older ones that the update lacks were declined by the edge, or have become redundant there.
  std::copy_if(made_.begin(), made_.end(), std::back_inserter(kept),
               [&](const BackedKeyFrame& made) { return made.keyframe > newest; });
  return kept;
}

void RecoveryBackup::applied(std::span<const KeyFrameId> updated) {
  if (reference_ && is_over(updated)) recovered({});
}

}  // namespace slambed
