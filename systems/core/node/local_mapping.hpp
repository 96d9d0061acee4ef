// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <memory>

#include "node/event_log.hpp"
#include "runtime/mailbox.hpp"
#include "slam/local_mapper.hpp"
#include "slam/tracker.hpp"

namespace slambed {

/// Runs the mapper's stages for one keyframe after the other (ORB-SLAM2's order): insert,
/// cull_points, triangulate, fuse, bundle, cull_keyframes. A keyframe that waits cuts the later
/// stages short, a running bundle between two iterations. Each stage's delta is committed when the
/// stage is over.
///
/// Either on a worker of its own (start) or, sequentially, inside submit().
class LocalMapping {
 public:
  enum class Mode { kWorker, kSequential };
  /// Called on the mapping side after a keyframe was worked in, before the next is taken.
  using Done = std::function<void(Worker&, KeyFrameId)>;

  LocalMapping(Runtime& runtime, EventLog& log, LocalMapperOptions options,
               std::shared_ptr<Map> map, IdSpace ids, Mode mode);

  void on_done(Done done) { done_ = std::move(done); }
  /// What must be in the map before the stages run is committed by prepare, on the mapping side; it
  /// returns false when the keyframe is not to be mapped after all.
  void on_take(std::function<bool(Worker&, KeyFrameId)> prepare) { prepare_ = std::move(prepare); }

  /// On the mapping side: the mapper's points count on behind this one.
  void skip(MapPointId used) { mapper_.skip(used); }

  /// Called when nothing waits, but not while parked; returns when it wants to be called again
  /// (kNever: after the next keyframe).
  void on_idle(std::function<RunTime(Worker&)> idle) { idle_ = std::move(idle); }
  /// Called on the mapping side whenever it goes on with a map, be it the same one, before reset()
  /// returns.
  void on_change(std::function<void()> change) { change_ = std::move(change); }

  void start(const std::string& worker_name = "mapping");
  /// Queues a keyframe of the map gone on to last (sequential: maps it now).
  void submit(Worker& worker, KeyFrameId keyframe);
  MapperStatus status() const;
  /// Drops what waits, ends what runs and continues on another map; returns when that has happened.
  void reset(Worker& worker, std::shared_ptr<Map> map);
  /// The same, but returns at once: what runs ends by itself, on the old map.
  void go_on_with(std::shared_ptr<Map> map);
  /// Returns when nothing waits or runs any more.
  void drain(Worker& worker);
  /// A parked mapper finishes its keyframe and then leaves queue and map alone.
  void park(bool parked);
  bool parked() const { return parked_; }
  /// No keyframe is accepted while the map is being put right.
  void hold(bool held) { held_ = held; }
  /// Lets the mapping side come round to on_idle. From any worker.
  void wake() { queue_.signal().notify(); }

 private:
  struct Task {
    KeyFrameId keyframe;       ///< none: only go on to the map
    std::shared_ptr<Map> map;  ///< null: the one at hand
    int change = 0;            ///< number of the change of map
  };

  void run(Worker& worker);
  void adopt(Task task);
  void map_keyframe(Worker& worker, KeyFrameId keyframe);
  void bundle(Worker& worker);
  template <typename Stage>
  void commit_stage(Worker& worker, std::string_view name, StageUnits size, Stage stage);
  bool leaving() const { return changes_done_ != changes_asked_; }
  bool interrupted() const { return mode_ == Mode::kWorker && (waiting_ > 0 || leaving()); }

  Runtime& runtime_;
  EventLog& log_;
  std::shared_ptr<Map> map_;  ///< changed on the mapping side only
  LocalMapperOptions options_;
  LocalMapper mapper_;
  Mode mode_;
  Done done_;
  std::function<bool(Worker&, KeyFrameId)> prepare_;
  std::function<RunTime(Worker&)> idle_;
  std::function<void()> change_;
  Mailbox<Task> queue_;
  std::unique_ptr<Signal> settled_;  ///< a keyframe is done, or a change of map
  std::atomic<int> waiting_{0};      ///< keyframes in the queue
  std::atomic<bool> busy_{false}, parked_{false}, held_{false};
  std::atomic<int> changes_asked_{0}, changes_done_{0};  ///< of map
};

}  // namespace slambed
