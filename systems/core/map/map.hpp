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

/// What a commit did, for events and tests.
struct CommitReport {
  int applied = 0;  ///< edits that changed something
  int stale = 0;    ///< older than what the map holds
  int unknown = 0;  ///< named an element that is not (any longer) there
};

/// Which keyframes came and went: lets a follower catch up at the price of what changed.
struct KeyFrameJournal {
  /// Of a map between two clears: a follower that keeps it never takes another one for this.
  std::shared_ptr<const std::byte> generation = std::make_shared<const std::byte>();
  std::vector<KeyFrameId> changes;  ///< each coming and each going names the keyframe once more
};

/// Read access to a consistent state; valid only inside Map::read.
class MapView {
 public:
  virtual ~MapView() = default;
  virtual const KeyFrame* keyframe(KeyFrameId id) const = 0;  ///< null: unknown or culled
  virtual const MapPoint* point(MapPointId id) const = 0;     ///< null: unknown, culled or fused
  /// The point that a fused one became, itself when it lives, none when culled.
  virtual MapPointId resolve(MapPointId id) const = 0;
  /// Pose of a keyframe even after it was culled (through its parent), if it was ever known.
  virtual std::optional<SE3> pose_of(KeyFrameId id) const = 0;
  virtual std::vector<KeyFrameId> keyframe_ids() const = 0;  ///< ascending
  virtual std::vector<MapPointId> point_ids() const = 0;     ///< ascending
  virtual std::size_t keyframe_count() const = 0;
  virtual std::size_t point_count() const = 0;
  /// The first keyframe, root of the spanning tree: the one that never moves. None in an empty map.
  virtual KeyFrameId origin() const = 0;
  /// The map's epoch (MapDelta::epoch): the highest one of any committed delta.
  virtual std::uint64_t epoch() const = 0;
  /// Grows with every commit that changed more than observations: equal means nothing else has
  /// changed.
  virtual std::uint64_t revision() const = 0;
  virtual const KeyFrameJournal& keyframe_journal() const = 0;
};

/// Keyframes, points and covisibility. Changes only through commit(); readers run under a shared
/// lock and copy what they need, whoever computes for long works on the copy. Corrections of
/// the whole map (a loop, a jump) are computed while it is held.
///
/// What commit() derives, once per commit and only for elements that were touched: covisibility and
/// its order, parents, weights, and of points whose observations or position changed the
/// descriptor, normal and distance range. A point that came with an appearance keeps it until
/// observations of it known here change; one without (max_distance_m 0) gets it from its
/// observations. A point whose weight fell to two or less in a commit is culled.
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
  /// Held by a writer while it waits for readers to leave, so that a stream of readers cannot keep
  /// it out. Taken before mutex_.
  mutable std::mutex entrance_;
  mutable std::shared_mutex mutex_;
  std::unique_ptr<State> state_;
  std::atomic<std::uint64_t> revision_{0};
};

}  // namespace slambed
