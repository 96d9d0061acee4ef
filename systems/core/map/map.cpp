// SPDX-License-Identifier: Apache-2.0
#include "map/map.hpp"

#include <algorithm>
#include <mutex>

#include "map/map_state.hpp"

namespace slambed {

struct Map::State {
  MapState elements;
};

Map::Map() : state_(std::make_unique<State>()) {}
Map::~Map() = default;

const MapView& Map::view() const { return state_->elements; }

CommitReport Map::commit(const MapDelta& delta) {
  const std::lock_guard keep_new_readers_out(entrance_);
  const std::unique_lock lock(mutex_);
  MapState& map = state_->elements;
  CommitReport report;
  const auto note = [&report](Edit edit) {
    report.applied += edit == Edit::kApplied;
    report.stale += edit == Edit::kStale;
    report.unknown += edit == Edit::kUnknown;
  };
  for (const auto& edit : delta.points) note(map.put(edit));
  for (const auto& edit : delta.keyframes) note(map.put(edit));
  for (const auto& edit : delta.attach) note(map.attach(edit));
  for (const auto& edit : delta.detach) note(map.detach(edit));
  for (const auto& edit : delta.fusions) note(map.fuse(edit));
  for (const auto& edit : delta.positions) note(map.move(edit));
  for (const auto& edit : delta.poses) note(map.move(edit));
  const int before_counts = report.applied;
  for (const auto& edit : delta.observation_counts) note(map.count(edit));
  const int after_counts = report.applied;
  for (const MapPointId id : delta.culled_points) note(map.cull(id));
  for (const KeyFrameId id : delta.culled_keyframes) note(map.cull(id));
  map.finish();
  map.set_epoch(std::max(map.epoch(), delta.epoch));
  if (before_counts + report.applied - after_counts > 0) {
    map.set_revision(map.revision() + 1);
    revision_.store(map.revision(), std::memory_order_release);
  }
  return report;
}

void Map::clear() {
  const std::lock_guard keep_new_readers_out(entrance_);
  const std::unique_lock lock(mutex_);
  MapState& map = state_->elements;
  const std::uint64_t revision = map.revision() + 1;
  map.clear();
  map.set_revision(revision);
  revision_.store(revision, std::memory_order_release);
}

}  // namespace slambed
