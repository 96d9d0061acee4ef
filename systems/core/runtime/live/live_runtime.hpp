// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "runtime/live/pace.hpp"
#include "runtime/observer.hpp"
#include "runtime/runtime.hpp"

namespace slambed {

/// Nanoseconds of CLOCK_MONOTONIC.
Duration monotonic_now();

/// Workers are threads, and time is CLOCK_MONOTONIC minus the run's t0. A stage takes the time of
/// its work or, with a pace, the time that a device would take.
class LiveRuntime final : public Runtime {
 public:
  explicit LiveRuntime(Observer& observer, std::optional<PaceOptions> pace = {});
  /// Stops and joins the remaining workers. Drops an exception that join() has not rethrown.
  ~LiveRuntime() override;

  /// Sets run time zero, an instant of CLOCK_MONOTONIC. Until then run time counts from boot.
  void set_origin(Duration t0);

  RunTime now() const override;
  std::unique_ptr<Signal> make_signal() override;
  void spawn(std::string name, std::function<void(Worker&)> body) override;
  void stop() override;
  void join() override;
  bool stopping() const { return stopping_; }
  Duration origin() const { return Duration(origin_ns_.load()); }

 private:
  class LiveSignal;
  class LiveWorker;

  void enlist(LiveSignal& signal);
  void dismiss(LiveSignal& signal);
  void fail(std::exception_ptr error);

  Observer& observer_;
  std::optional<Pace> pace_;
  std::atomic<std::int64_t> origin_ns_{0};
  std::atomic<bool> stopping_{false};
  std::mutex mutex_;  ///< guards what follows
  std::vector<LiveSignal*> signals_;
  std::vector<std::thread> threads_;
  std::exception_ptr error_;
};

}  // namespace slambed
