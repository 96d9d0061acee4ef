// SPDX-License-Identifier: Apache-2.0
#include "node/loop_closing.hpp"

#include <utility>

#include "node/counts.hpp"

namespace slambed {

LoopClosing::LoopClosing(Runtime& runtime, EventLog& log, LoopCloserOptions options,
                         std::shared_ptr<Map> map, const std::shared_ptr<PlaceIndex>& places,
                         LocalMapping& mapping, LocalMapping::Mode mode, Commit commit)
    : runtime_(runtime),
      log_(log),
      bundle_options_(options.bundle),
      map_(std::move(map)),
      closer_(options, map_, places),
      mapping_(mapping),
      mode_(mode),
      commit_(std::move(commit)),
      wanted_(runtime),
      finished_(runtime) {
  if (!commit_) commit_ = [this](const MapDelta& delta) { map_->commit(delta); };
}

void LoopClosing::start() {
  if (mode_ == LocalMapping::Mode::kSequential) return;
  runtime_.spawn("global-bundle", [this](Worker& worker) { work(worker); });
}

void LoopClosing::mapped(Worker& worker, KeyFrameId keyframe) {
  idle(worker);
  const bool found = worker.stage("loop_detect", [&](StageUnits& units) {
    units.n1 = static_cast<double>(count(*map_).keyframes);
    return closer_.detect(keyframe) && closer_.verify();
  });
  if (found) close(worker);
}

void LoopClosing::close(Worker& worker) {
  mapping_.set_accepting(false);
  ++generation_;
  const MapCounts size = count(*map_);
  const auto charge = [&](StageUnits& units) {
    units = {static_cast<double>(size.keyframes), static_cast<double>(size.points)};
  };
  std::size_t fused = 0;
  bool closed = false;
  // Deltas are computed where they are committed, so that the map cannot change in between.
  const auto nothing = [&](StageUnits& units) {
    charge(units);
    return 0;
  };
  {
    const MapLock::Hold hold(mapping_.lock(), worker, "mapping");
    worker.stage("loop_close", nothing, [&](int) {
      const MapDelta delta = closer_.correct();
      fused = delta.fusions.size();
      closed = !delta.empty();
      commit_(delta);
    });
  }
  if (closed && worker.stage("loop_close", [&](StageUnits& units) {
        charge(units);
        return closer_.begin_graph();
      })) {
    while (worker.stage("loop_close", [&](StageUnits& units) {
      charge(units);
      return closer_.step_graph();
    })) {
    }
    const MapLock::Hold hold(mapping_.lock(), worker, "mapping");
    worker.stage("loop_close", nothing, [&](int) { commit_(closer_.finish_graph()); });
  }
  mapping_.set_accepting(true);
  if (!closed) return;
  log_.write(JsonLine("loop_closed")
                 .add("keyframe", closer_.loop().keyframe.value)
                 .add("matched", closer_.loop().matched.value)
                 .add("matches", closer_.loop().matches)
                 .add("fused", fused)
                 .add("keyframes", size.keyframes));
  if (mode_ == LocalMapping::Mode::kSequential) {
    if (const auto bundle = adjust(worker, generation_)) commit_bundle(worker, *bundle);
    return;
  }
  ++open_;
  wanted_.put(generation_);
}

std::unique_ptr<GlobalBundle> LoopClosing::adjust(Worker& worker, int generation) {
  std::unique_ptr<GlobalBundle> bundle;
  worker.stage("global_bundle", [&](StageUnits& units) {
    if (auto begun = GlobalBundle::of(*map_, bundle_options_))
      bundle = std::make_unique<GlobalBundle>(std::move(*begun));
    if (bundle) units.n1 = static_cast<double>(bundle->observations());
    return 0;
  });
  if (!bundle) return nullptr;
  while (worker.stage("global_bundle", [&](StageUnits& units) {
    units.n2 = static_cast<double>(bundle->observations());
    return bundle->step();
  })) {
    if (generation != generation_ || worker.stopping()) return nullptr;
  }
  return bundle;
}

void LoopClosing::commit_bundle(Worker& worker, const GlobalBundle& bundle) {
  const MapLock::Hold hold(mapping_.lock(), worker, "mapping");
  worker.stage(
      "global_bundle",
      [&](StageUnits& units) {
        units.n1 = static_cast<double>(bundle.observations());
        return 0;
      },
      [&](int) { commit_(bundle.result(*map_)); });
}

void LoopClosing::work(Worker& worker) {
  while (const auto generation = wanted_.take(worker)) {
    Finished finished{*generation, nullptr};
    if (*generation == generation_) finished.bundle = adjust(worker, *generation);
    finished_.put(std::move(finished));
    mapping_.wake();
  }
}

void LoopClosing::idle(Worker& worker) {
  while (auto finished = finished_.try_take()) {
    if (finished->bundle && finished->generation == generation_)
      commit_bundle(worker, *finished->bundle);
    --open_;
    mapping_.progressed().notify();
  }
}

void LoopClosing::map_changed() {
  cancel();
  closer_.replace_map(map_);
}

Completion LoopClosing::drained() {
  return {mapping_.progressed(), [this] { return open_ == 0; },
          [this] { return mapping_.parked(); }};
}

}  // namespace slambed
