// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>

#include "node/completion.hpp"
#include "node/event_log.hpp"
#include "node/map_lock.hpp"
#include "runtime/mailbox.hpp"
#include "slam/local_mapper.hpp"
#include "slam/tracker.hpp"

namespace slambed {

/// Optional callbacks on the mapping side, between two stages.
struct MappingHooks {
  /// Commits what the map needs before the stages run; false: the keyframe is not mapped.
  std::function<bool(Worker&, KeyFrameId)> prepare;
  /// Runs after a keyframe was mapped, before the next one.
  std::function<void(Worker&, KeyFrameId)> done;
  /// Runs when the queue is empty and mapping is not parked. Returns the time of its next call
  /// (kNever: after the next keyframe or wake()).
  std::function<RunTime(Worker&)> idle;
  /// Runs whenever mapping switches to a map, even to the same one, before the change is complete.
  std::function<void()> changed;
  /// Held while the result of a bundle is committed; null: no lock.
  MapLock* lock = nullptr;
};

/// Runs the mapper's stages for each keyframe in ORB-SLAM2's order: insert, cull_points,
/// triangulate, fuse, bundle, cull_keyframes. If another keyframe is waiting, the later stages are
/// skipped and a running bundle stops after its iteration. Each stage's delta is committed when the
/// stage ends.
///
/// Runs on its own worker (start) or, in sequential mode, inside submit().
class LocalMapping {
 public:
  enum class Mode { kWorker, kSequential };

  LocalMapping(Runtime& runtime, EventLog& log, LocalMapperOptions options,
               std::shared_ptr<Map> map, IdSpace ids, Mode mode, MappingHooks hooks = {});

  void start(const std::string& worker_name = "mapping");
  /// Queues a keyframe of the map of the last reset() (sequential: maps it now). Complete when it
  /// was mapped, or dropped by a reset; cannot complete while parked.
  Completion submit(Worker& worker, KeyFrameId keyframe);
  /// Drops queued keyframes, interrupts the current one and continues on another map, even while
  /// parked. Until that is complete the current keyframe still uses the old map.
  Completion reset(std::shared_ptr<Map> map);
  /// Complete when nothing is queued or running; cannot complete while parked.
  Completion drained();
  MapperStatus status() const;
  /// A parked mapper finishes its keyframe and then touches neither queue nor map.
  void park(bool parked);
  /// Gives later points of the mapper ids above this one. Call it on the mapping side.
  void skip(MapPointId used) { mapper_.skip(used); }
  bool parked() const { return parked_; }
  /// Returns a correction of the map, with a new epoch, and the limits of later bundles.
  using Correction = std::function<std::pair<MapDelta, BundleLimits>(const MapView&)>;
  /// Computes and commits a correction while mapping commits nothing. Call it from any worker but
  /// mapping's own. The delta of a stage in progress loses its poses, positions and new points.
  /// Bundles keep to the limits from the next keyframe on.
  void correct(Map& map, const Correction& correction);
  /// The lock to hold while writing to the map on the mapping side; may be null.
  MapLock* lock() const { return hooks_.lock; }
  /// False while the map is being corrected, so that no keyframes are made.
  void set_accepting(bool accepting) { accepting_ = accepting; }
  /// Wakes the mapping worker so that it runs the hook `idle`. Call it from any worker.
  void wake() { queue_.signal().notify(); }
  /// Notified when a keyframe is done, the map is replaced or mapping is parked. Work that follows
  /// mapping also notifies it when done.
  Signal& progressed() { return *progressed_; }

 private:
  struct Task {
    KeyFrameId keyframe;       ///< none: only a change of map
    std::shared_ptr<Map> map;  ///< null: no change of map
    int change = 0;            ///< number of the change of map
    int submitted = 0;         ///< keyframes up to and including this one
  };

  void run(Worker& worker);
  void adopt(Task task);
  void map_keyframe(Worker& worker, KeyFrameId keyframe);
  void bundle(Worker& worker);
  template <typename Stage>
  void commit_stage(Worker& worker, std::string_view name, StageUnits size, Stage stage);
  bool leaving() const { return changes_done_ != changes_asked_; }
  bool interrupted() const { return mode_ == Mode::kWorker && (waiting_ > 0 || leaving()); }

  void commit(MapDelta delta);

  Runtime& runtime_;
  EventLog& log_;
  std::shared_ptr<Map> map_;  ///< changed on the mapping side only
  std::mutex commit_mutex_;   ///< held while a change is committed; guards limits_
  BundleLimits limits_;
  LocalMapperOptions options_;
  LocalMapper mapper_;
  Mode mode_;
  MappingHooks hooks_;
  Mailbox<Task> queue_;
  std::unique_ptr<Signal> progressed_;            ///< a keyframe is done, or a change of map
  std::atomic<int> waiting_{0};                   ///< keyframes in the queue
  std::atomic<int> submitted_{0}, completed_{0};  ///< numbers of keyframes, in order of submission
  std::atomic<bool> busy_{false}, parked_{false}, accepting_{true};
  std::atomic<int> changes_asked_{0}, changes_done_{0};  ///< changes of map
};

}  // namespace slambed
