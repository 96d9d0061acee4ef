// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <memory>
#include <string_view>

#include "node/event_log.hpp"
#include "runtime/runtime.hpp"

namespace slambed {

/// Models ORB-SLAM2's mMutexMapUpdate. Tracking holds it for a whole frame after extraction
/// (Tracking.cc, Track), and so does any worker that writes an optimized map back (Optimizer.cc and
/// LoopClosing.cc). Our maps need no such lock; it only reproduces the waiting. Each wait is logged
/// as an event `map_wait`.
class MapLock {
 public:
  MapLock(Runtime& runtime, EventLog& log) : log_(log), released_(runtime.make_signal()) {}

  /// Not fair, like the original. Returns without the lock once the run stops.
  void acquire(Worker& worker, std::string_view who);
  void release();

  /// Holds the lock for a scope; does nothing if the lock is null.
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
