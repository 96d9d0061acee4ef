// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <memory>
#include <string_view>

#include "node/event_log.hpp"
#include "runtime/runtime.hpp"

namespace slambed {

/// ORB-SLAM2's mMutexMapUpdate as a model of its own: held by tracking for a whole frame behind
/// extraction (Tracking.cc, Track), and by whoever writes an optimized map back (Optimizer.cc and
/// LoopClosing.cc). Our maps need no such lock; who holds it only makes the others wait, as long as
/// the stages in between take. Whoever had to wait is told in an event `map_wait`.
class MapLock {
 public:
  MapLock(Runtime& runtime, EventLog& log) : log_(log), released_(runtime.make_signal()) {}

  /// Not fair, as the original is not. Without the lock once the run stops: then nobody minds.
  void acquire(Worker& worker, std::string_view who);
  void release();

  /// For the time of a scope; of no lock (null) nothing is held.
  class Hold {
   public:
    Hold(MapLock* lock, Worker& worker, std::string_view who) : lock_(lock) {
      if (lock_) lock_->acquire(worker, who);
    }
    ~Hold() {
      if (lock_) lock_->release();
    }
    Hold(const Hold&) = delete;
    Hold& operator=(const Hold&) = delete;

   private:
    MapLock* lock_;
  };

 private:
  EventLog& log_;
  std::unique_ptr<Signal> released_;
  std::atomic<bool> held_{false};
};

}  // namespace slambed
