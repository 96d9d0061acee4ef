// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <memory>

#include "node/event_log.hpp"
#include "node/local_mapping.hpp"
#include "runtime/mailbox.hpp"
#include "slam/global_bundle.hpp"
#include "slam/loop_closer.hpp"

namespace slambed {

/// Closes loops after local mapping. All changes of the map happen on the mapping side, between two
/// keyframes. The global bundle runs on its own worker, and its result is committed on the mapping
/// side. No keyframe is accepted while a loop is being closed. A newer loop or a reset of the
/// mapping cancels a running bundle at its next step.
///
/// The owner must call mapped(), idle() and map_changed() from LocalMapping's hooks.
class LoopClosing {
 public:
  /// Commits a change on the mapping side.
  using Commit = std::function<void(const MapDelta&)>;

  /// commit: replaces Map::commit if set.
  LoopClosing(Runtime& runtime, EventLog& log, LoopCloserOptions options, std::shared_ptr<Map> map,
              const std::shared_ptr<PlaceIndex>& places, LocalMapping& mapping,
              LocalMapping::Mode mode, Commit commit = {});

  /// Starts the bundle's worker (not in sequential mode: there the bundle runs at once).
  void start();
  /// On the mapping side, after a keyframe was mapped.
  void mapped(Worker& worker, KeyFrameId keyframe);
  /// On the mapping side, when the queue is empty: commits a finished bundle.
  void idle(Worker& worker);
  /// On the mapping side, when the map changes: drops pending work.
  void map_changed();
  /// Complete when no bundle runs or waits to be committed; cannot complete while mapping is
  /// parked. Call it once mapping is drained, because a queued keyframe may close another loop.
  Completion drained();
  /// Cancels a pending bundle. Call it from any worker.
  void cancel() { ++generation_; }

 private:
  struct Finished {
    int generation = 0;
    std::unique_ptr<GlobalBundle> bundle;
  };

  void close(Worker& worker);
  std::unique_ptr<GlobalBundle> adjust(Worker& worker, int generation);
  void commit_bundle(Worker& worker, const GlobalBundle& bundle);
  void work(Worker& worker);

  Runtime& runtime_;
  EventLog& log_;
  BundleOptions bundle_options_;
  std::shared_ptr<Map> map_;
  LoopCloser closer_;
  LocalMapping& mapping_;
  LocalMapping::Mode mode_;
  Commit commit_;
  std::atomic<int> generation_{0};  ///< counts loops and resets
  std::atomic<int> open_{0};        ///< bundles requested and not yet committed or dropped
  Mailbox<int> wanted_;             ///< generations to adjust
  Mailbox<Finished> finished_;
};

}  // namespace slambed
