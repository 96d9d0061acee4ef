// SPDX-License-Identifier: Apache-2.0
#include "slam/loop_detector.hpp"

#include <algorithm>

namespace slambed {
namespace {

bool share_one(const std::vector<KeyFrameId>& a, const std::vector<KeyFrameId>& b) {
  auto i = a.begin(), j = b.begin();
  while (i != a.end() && j != b.end()) {
    if (*i == *j) return true;
    *i < *j ? ++i : ++j;
  }
  return false;
}

/// The keyframe and every one that shares a point with it, ascending.
std::vector<KeyFrameId> group_around(const KeyFrame& keyframe) {
  std::vector<KeyFrameId> group{keyframe.id};
  for (const Covisible& other : keyframe.connected) group.push_back(other.id);
  std::sort(group.begin(), group.end());
  return group;
}

}  // namespace

std::vector<KeyFrameId> LoopDetector::detect(const Map& map, KeyFrameId id) {
  places_->update_from(map);
  const auto bag = places_->bag(id);
  if (!bag) return {};
  if (quiet_ > 0) {
    --quiet_;
    groups_.clear();
    return {};
  }
  std::vector<KeyFrameId> around, near;
  map.read([&](const MapView& view) {
    const KeyFrame* keyframe = view.keyframe(id);
    if (!keyframe) return;
    around = group_around(*keyframe);
    for (const Covisible& other : keyframe->covisibles) near.push_back(other.id);
  });
  if (around.empty()) return {};
  double least = 1;
  for (const KeyFrameId other : near)
    if (const auto theirs = places_->bag(other)) least = std::min(least, similarity(*bag, *theirs));
  std::vector<KeyFrameId> candidates = places_->candidates(*bag, map, around, least);
  if (candidates.size() > options_.candidates) candidates.resize(options_.candidates);
  return map.read([&](const MapView& view) {
    std::vector<Group> groups;
    std::vector<KeyFrameId> consistent;
    for (const KeyFrameId candidate : candidates) {
      const KeyFrame* keyframe = view.keyframe(candidate);
      if (!keyframe) continue;
      Group group;
      group.keyframes = group_around(*keyframe);
      for (const Group& before : groups_)
        if (share_one(before.keyframes, group.keyframes))
          group.seen = std::max(group.seen, before.seen + 1);
      if (group.seen >= options_.consistency) consistent.push_back(candidate);
      groups.push_back(std::move(group));
    }
    groups_ = std::move(groups);
    return consistent;
  });
}

void LoopDetector::closed() {
  groups_.clear();
  quiet_ = options_.quiet_keyframes - 1;
}

void LoopDetector::reset() {
  groups_.clear();
  quiet_ = 0;
}

}  // namespace slambed
