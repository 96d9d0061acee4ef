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

/// Closes loops behind a LocalMapping. Everything that changes the map happens on the mapping side,
/// between two keyframes; the global bundle computes on a worker of its own and is committed there
/// when it is done. While a loop is being closed no keyframe is accepted. A newer loop or a reset
/// of the mapping makes a running bundle worthless: it stops at its next step.
///
/// Whoever owns both lets LocalMapping's hooks call mapped(), idle() and map_changed().
class LoopClosing {
 public:
  /// Commits a change on the mapping side.
  using Commit = std::function<void(const MapDelta&)>;

  /// commit: in place of Map::commit.
  LoopClosing(Runtime& runtime, EventLog& log, LoopCloserOptions options, std::shared_ptr<Map> map,
              const std::shared_ptr<PlaceIndex>& places, LocalMapping& mapping,
              LocalMapping::Mode mode, Commit commit = {});

  /// Starts the bundle's worker (not in sequential mode: there the bundle runs at once).
  void start();
  /// On the mapping side, after a keyframe was mapped.
  void mapped(Worker& worker, KeyFrameId keyframe);
  /// On the mapping side, when nothing waits: commits a bundle that is done.
  void idle(Worker& worker);
  /// On the mapping side, when it goes on with a map: what is under way is worth nothing.
  void map_changed();
  /// Complete when no bundle runs or waits to be committed; cannot complete while mapping is
  /// parked. To be asked when mapping is drained: a keyframe that waits may close another loop.
  Completion drained();
  /// What is under way is worth nothing any more. From any worker.
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
  std::atomic<int> generation_{0};  ///< of the map as loops and resets left it
  std::atomic<int> open_{0};        ///< bundles asked for and not yet committed or dropped
  Mailbox<int> wanted_;             ///< generations to adjust
  Mailbox<Finished> finished_;
};

}  // namespace slambed
