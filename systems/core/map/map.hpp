// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <shared_mutex>
#include <utility>
#include <vector>

#include "map/elements.hpp"
#include "map/map_delta.hpp"

namespace slambed {

/// Counts of the edits of one commit, for events and tests.
struct CommitReport {
  int applied = 0;  ///< edits that changed something
  int stale = 0;    ///< not newer than what the map holds
  int unknown = 0;  ///< named an element that does not exist (any more)
};

/// Log of added and culled keyframes, so that an index can follow the map incrementally.
struct KeyFrameJournal {
  /// Identifies the map between two clears. While a reader holds it, no other generation can have
  /// the same address.
  std::shared_ptr<const std::byte> generation = std::make_shared<const std::byte>();
  std::vector<KeyFrameId> changes;  ///< one entry per addition and per culling
};

/// Read access to a consistent state; valid only inside Map::read.
class MapView {
 public:
  virtual ~MapView() = default;
  virtual const KeyFrame* keyframe(KeyFrameId id) const = 0;  ///< null: unknown or culled
  virtual const MapPoint* point(MapPointId id) const = 0;     ///< null: unknown, culled or fused
  /// Returns the survivor of a fused point, the id itself for a live point, or none if culled.
  virtual MapPointId resolve(MapPointId id) const = 0;
  /// Returns T_cw of a keyframe, also after it was culled (through its parent), if it ever existed.
  virtual std::optional<SE3> pose_of(KeyFrameId id) const = 0;
  virtual std::vector<KeyFrameId> keyframe_ids() const = 0;  ///< ascending
  virtual std::vector<MapPointId> point_ids() const = 0;     ///< ascending
  virtual std::size_t keyframe_count() const = 0;
  virtual std::size_t point_count() const = 0;
  /// The first keyframe: root of the spanning tree, which never moves. None in an empty map.
  virtual KeyFrameId origin() const = 0;
  /// The highest MapDelta::epoch of any committed delta.
  virtual std::uint64_t epoch() const = 0;
  /// Grows with every commit that changed more than observation counts. If it is equal, nothing
  /// else has changed.
  virtual std::uint64_t revision() const = 0;
  virtual const KeyFrameJournal& keyframe_journal() const = 0;
};

/// Keyframes, points and covisibility. They change only through commit(). Readers hold a shared
/// lock, and long computations work on a copy. Only corrections of the whole map (a loop, a jump)
/// are computed under the lock.
///
/// commit() updates derived state once per commit and only for touched elements: covisibility and
/// its order, parents, weights, and the appearance of points whose observations or position
/// changed. A point added with an appearance keeps it until its observations in this map change. A
/// point added without one (max_distance_m 0) gets it from its observations. A point whose weight
/// drops to two or less in a commit is culled.
class Map {
 public:
  Map();
  ~Map();

  CommitReport commit(const MapDelta& delta);
  void clear();
  /// MapView::revision() without taking the lock.
  std::uint64_t revision() const { return revision_.load(std::memory_order_acquire); }

  /// Runs f(const MapView&) under the shared lock and returns its result.
  template <typename F>
  auto read(F&& f) const {
    { const std::lock_guard wait_behind_a_writer(entrance_); }
    const std::shared_lock lock(mutex_);
    return std::forward<F>(f)(view());
  }

 private:
  struct State;
  const MapView& view() const;
  /// A writer holds it while it waits for mutex_, so that a stream of readers cannot starve it.
  /// Locked before mutex_.
  mutable std::mutex entrance_;
  mutable std::shared_mutex mutex_;
  std::unique_ptr<State> state_;
  std::atomic<std::uint64_t> revision_{0};
};

}  // namespace slambed
