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

/// What others do on the mapping side, between two stages. Each may be left out.
struct MappingHooks {
  /// Commits what must be in the map before the stages run; false: the keyframe is not to be mapped
  /// after all.
  std::function<bool(Worker&, KeyFrameId)> prepare;
  /// After a keyframe was mapped, before the next is begun.
  std::function<void(Worker&, KeyFrameId)> done;
  /// When nothing waits, but not while parked; returns when it wants to be called again (kNever:
  /// after the next keyframe).
  std::function<RunTime(Worker&)> idle;
  /// Whenever mapping goes on with a map, be it the same one, before the change is complete.
  std::function<void()> changed;
  /// Held while what a bundle has found is written back; null: nobody waits for that.
  MapLock* lock = nullptr;
};

/// Runs the mapper's stages for one keyframe after the other (ORB-SLAM2's order): insert,
/// cull_points, triangulate, fuse, bundle, cull_keyframes. A keyframe that waits cuts the later
/// stages short, a running bundle between two iterations. Each stage's delta is committed when the
/// stage is over.
///
/// Either on a worker of its own (start) or, sequentially, inside submit().
class LocalMapping {
 public:
  enum class Mode { kWorker, kSequential };

  LocalMapping(Runtime& runtime, EventLog& log, LocalMapperOptions options,
               std::shared_ptr<Map> map, IdSpace ids, Mode mode, MappingHooks hooks = {});

  void start(const std::string& worker_name = "mapping");
  /// Queues a keyframe of the map gone on to last (sequential: maps it now). Complete when it was
  /// mapped, or dropped by a change of map; cannot complete while parked.
  Completion submit(Worker& worker, KeyFrameId keyframe);
  /// Drops what waits, ends what runs and continues on another map (also while parked). Until that
  /// is complete what runs goes on, on the old map.
  Completion reset(std::shared_ptr<Map> map);
  /// Complete when nothing waits or runs; cannot complete while parked.
  Completion drained();
  MapperStatus status() const;
  /// A parked mapper finishes its keyframe and then leaves queue and map alone.
  void park(bool parked);
  /// On the mapping side: the mapper's points count on behind this one.
  void skip(MapPointId used) { mapper_.skip(used); }
  bool parked() const { return parked_; }
  /// A correction of the map, under a new epoch, and what bundles have to keep to from then on.
  using Correction = std::function<std::pair<MapDelta, BundleLimits>(const MapView&)>;
  /// Commits what the function makes of the map as it is, from any worker but mapping's own;
  /// mapping commits nothing in between. What a stage that runs computes on the map as it was loses
  /// its poses and positions; bundles keep to the limits from the next keyframe on.
  void correct(Map& map, const Correction& correction);
  /// What whoever writes to the map behind mapping holds meanwhile; null: nothing.
  MapLock* lock() const { return hooks_.lock; }
  /// Off while the map is being put right: no keyframe is asked for then.
  void set_accepting(bool accepting) { accepting_ = accepting; }
  /// Lets the mapping side come round to its hook `idle`. From any worker.
  void wake() { queue_.signal().notify(); }
  /// Notified when a keyframe is done, the map is another or mapping is parked; whatever works
  /// behind mapping notifies it too when it is done.
  Signal& progressed() { return *progressed_; }

 private:
  struct Task {
    KeyFrameId keyframe;       ///< none: only go on to the map
    std::shared_ptr<Map> map;  ///< null: the one at hand
    int change = 0;            ///< number of the change of map
    int submitted = 0;         ///< keyframes until then, this one included
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
  std::atomic<int> submitted_{0}, completed_{0};  ///< keyframes; completed: of the first so many
  std::atomic<bool> busy_{false}, parked_{false}, accepting_{true};
  std::atomic<int> changes_asked_{0}, changes_done_{0};  ///< of map
};

}  // namespace slambed
