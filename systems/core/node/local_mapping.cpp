// SPDX-License-Identifier: Apache-2.0
#include "node/local_mapping.hpp"

#include <algorithm>

#include "node/counts.hpp"

namespace slambed {
namespace {

/// Size of the work on one keyframe.
struct WindowSize {
  double covisibles = 0;  ///< keyframes that share points with it
  double shared = 0;      ///< observations shared with them
  double unmatched = 0;   ///< features without a point
  double neighbors = 0;   ///< keyframes in which these are searched for
};

WindowSize window_size(const Map& map, KeyFrameId id, const LocalMapperOptions& options) {
  return map.read([&](const MapView& view) {
    WindowSize size;
    const KeyFrame* keyframe = view.keyframe(id);
    if (!keyframe) return size;
    size.covisibles = static_cast<double>(keyframe->covisibles.size());
    for (const Covisible& covisible : keyframe->covisibles) size.shared += covisible.weight;
    for (const MapPointId point : keyframe->points) size.unmatched += point ? 0 : 1;
    size.neighbors =
        std::min<double>(options.neighbors_for(keyframe->features->sensor()), size.covisibles);
    return size;
  });
}

/// Removes everything that was computed from positions before a correction of the map.
void leave_out_geometry(MapDelta& delta) {
  delta.poses.clear();
  delta.positions.clear();
  const auto fresh = [&](const ObservationEdit& edit) {
    return std::any_of(delta.points.begin(), delta.points.end(),
                       [&](const NewPoint& point) { return point.id == edit.point; });
  };
  std::erase_if(delta.attach, fresh);
  delta.points.clear();
}

}  // namespace

LocalMapping::LocalMapping(Runtime& runtime, EventLog& log, LocalMapperOptions options,
                           std::shared_ptr<Map> map, IdSpace ids, Mode mode, MappingHooks hooks)
    : runtime_(runtime),
      log_(log),
      map_(std::move(map)),
      options_(options),
      mapper_(options, map_, ids),
      mode_(mode),
      hooks_(std::move(hooks)),
      queue_(runtime),
      progressed_(runtime.make_signal()) {}

void LocalMapping::start(const std::string& worker_name) {
  if (mode_ == Mode::kSequential) return;
  runtime_.spawn(worker_name, [this](Worker& worker) { run(worker); });
}

Completion LocalMapping::submit(Worker& worker, KeyFrameId keyframe) {
  const int number = ++submitted_;
  if (mode_ == Mode::kSequential) {
    map_keyframe(worker, keyframe);
    completed_ = number;
  } else {
    ++waiting_;
    queue_.put({.keyframe = keyframe, .map = nullptr, .submitted = number});
  }
  return {*progressed_, [this, number] { return completed_ >= number; },
          [this] { return parked_.load(); }};
}

MapperStatus LocalMapping::status() const {
  return {.idle = waiting_ == 0 && !busy_,
          .queued = waiting_,
          .accepts = !parked_ && !leaving() && accepting_};
}

Completion LocalMapping::reset(std::shared_ptr<Map> map) {
  while (const auto dropped = queue_.try_take()) {
    if (dropped->keyframe) --waiting_;
  }
  const int change = ++changes_asked_;
  Task task{.keyframe = {}, .map = std::move(map), .change = change, .submitted = submitted_};
  if (mode_ == Mode::kSequential) {
    adopt(std::move(task));
  } else {
    queue_.put(std::move(task));
  }
  return {*progressed_, [this, change] { return changes_done_ >= change; }, [] { return false; }};
}

void LocalMapping::adopt(Task task) {
  map_ = std::move(task.map);
  mapper_.replace_map(map_);
  {
    const std::lock_guard lock(commit_mutex_);
    limits_ = {};
  }
  if (hooks_.changed) hooks_.changed();
  completed_ = task.submitted;
  changes_done_ = task.change;
  progressed_->notify();
}

Completion LocalMapping::drained() {
  return {*progressed_, [this] { return status().idle; }, [this] { return parked_.load(); }};
}

void LocalMapping::park(bool parked) {
  parked_ = parked;
  queue_.signal().notify();
  progressed_->notify();  // releases callers that wait for parked work
}

void LocalMapping::run(Worker& worker) {
  while (!worker.stopping()) {
    const auto ticket = queue_.signal().ticket();
    // A change of map is handled even while parked; it is first in the queue.
    if ((!parked_ || leaving()) && queue_.size() > 0) {
      busy_ = true;  // before the count falls, so status() is never idle in between
      auto task = queue_.try_take();
      if (task && task->keyframe) {
        --waiting_;
        map_keyframe(worker, task->keyframe);
        completed_ = task->submitted;
      }
      busy_ = false;
      if (task && task->map) adopt(std::move(*task));
      progressed_->notify();  // even if reset() has just emptied the queue
      continue;
    }
    worker.wait(queue_.signal(), ticket, hooks_.idle && !parked_ ? hooks_.idle(worker) : kNever);
  }
  progressed_->notify();
}

template <typename Stage>
void LocalMapping::commit_stage(Worker& worker, std::string_view name, StageUnits size,
                                Stage stage) {
  worker.stage(
      name,
      [&](StageUnits& units) {
        units = size;
        return stage();
      },
      [&](const MapDelta& delta) { commit(delta); });
}

void LocalMapping::commit(MapDelta delta) {
  const std::lock_guard lock(commit_mutex_);
  const auto now = map_->read([](const MapView& view) { return view.epoch(); });
  if (delta.epoch < now) leave_out_geometry(delta);
  map_->commit(delta);
}

void LocalMapping::correct(Map& map, const Correction& correction) {
  const std::lock_guard lock(commit_mutex_);
  auto [delta, limits] = map.read([&](const MapView& view) { return correction(view); });
  map.commit(delta);
  limits_ = limits;
}

void LocalMapping::map_keyframe(Worker& worker, KeyFrameId keyframe) {
  if (hooks_.prepare && !hooks_.prepare(worker, keyframe)) return;
  {
    const std::lock_guard lock(commit_mutex_);
    mapper_.limit_bundles(limits_);
  }
  const WindowSize window = window_size(*map_, keyframe, options_);
  const StageUnits size{window.covisibles, window.shared};
  worker.stage("insert", [&](StageUnits& units) {
    units = size;
    mapper_.insert(keyframe);
  });
  commit_stage(worker, "cull_points", size, [&] { return mapper_.cull_points(); });
  // Every unmatched feature is searched for in each neighbor.
  commit_stage(worker, "triangulate", {window.neighbors, window.neighbors * window.unmatched},
               [&] { return mapper_.triangulate(); });
  if (!interrupted()) commit_stage(worker, "fuse", size, [&] { return mapper_.fuse(); });
  if (!interrupted()) {
    bundle(worker);
    commit_stage(worker, "cull_keyframes", size, [&] { return mapper_.cull_keyframes(); });
  }
  if (leaving()) return;
  const MapCounts counts = count(*map_);
  log_.write(JsonLine("keyframe_mapped")
                 .add("keyframe", keyframe.value)
                 .add("keyframes", counts.keyframes)
                 .add("points", counts.points));
  if (hooks_.done) hooks_.done(worker, keyframe);
}

void LocalMapping::bundle(Worker& worker) {
  // n1: observations collected, n2: observations solved for. Both take time, but not equally much.
  const auto size = [&] { return static_cast<double>(mapper_.bundle_observations()); };
  const bool begun = worker.stage("bundle", [&](StageUnits& units) {
    const bool usable = mapper_.begin_bundle();
    units.n1 = size();
    return usable;
  });
  if (!begun) return;
  const auto step = [&] {
    return worker.stage("bundle", [&](StageUnits& units) {
      units.n2 = size();
      return mapper_.step_bundle();
    });
  };
  while (step()) {
    if (interrupted()) break;  // finish_bundle() discards an unfinished robust stage
  }
  if (leaving()) return;
  const MapLock::Hold hold(hooks_.lock, worker, "mapping");
  commit_stage(worker, "bundle", {0, size()}, [&] { return mapper_.finish_bundle(); });
}

}  // namespace slambed
