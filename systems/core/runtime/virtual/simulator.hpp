// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <semaphore>
#include <string>
#include <thread>
#include <vector>

#include "base/time.hpp"

namespace slambed {

class Simulator;

/// Thrown in a task when the simulation is over, to unwind it: nothing would wake it any more.
struct SimulationOver {};

/// A cooperative thread of the simulation. Exactly one task (or the simulator itself) runs at a
/// time, so code written for threads is deterministic without being rewritten as coroutines.
class Task {
 public:
  Task(Simulator& simulator, std::string name) : simulator_(simulator), name_(std::move(name)) {}
  const std::string& name() const { return name_; }

  /// Suspends the task until Simulator::resume is called for it. Only for the task's own thread.
  /// Throws SimulationOver if the simulation ends first.
  void suspend();

 private:
  friend class Simulator;
  Simulator& simulator_;
  std::string name_;
  std::binary_semaphore turn_{0};
  std::thread thread_;
  bool finished_ = false;
};

/// Discrete-event scheduler. Events of equal time run in the order in which they were scheduled, so
/// a run depends only on its inputs.
class Simulator {
 public:
  Simulator();
  /// Unwinds remaining tasks; those that never started do not run.
  ~Simulator();
  Simulator(const Simulator&) = delete;
  Simulator& operator=(const Simulator&) = delete;

  RunTime now() const { return now_; }
  /// Runs the action at the given time, not before now. Actions must not suspend.
  void at(RunTime when, std::function<void()> action) { schedule(when, std::move(action), false); }
  /// The same for an observing action: such events alone do not keep a run going.
  void at_background(RunTime when, std::function<void()> action) {
    schedule(when, std::move(action), true);
  }
  /// Creates a task that starts at the current time.
  Task& spawn(std::string name, std::function<void()> body);
  /// Wakes a suspended task at the current time.
  void resume(Task& task);
  /// Adds a hook that is called when no event is left but tasks still wait. It must make them end,
  /// and may be called twice.
  void on_stuck(std::function<void()> hook) { stuck_hooks_.push_back(std::move(hook)); }

  /// Runs until every task has ended. Throws Error(kInternal) naming the waiting tasks if the
  /// simulation was stuck, and rethrows what an action or a task threw. Before it returns or
  /// throws, it unwinds all remaining tasks, while the objects that they refer to still exist.
  void run();

 private:
  friend class Task;
  struct Event {
    RunTime time;
    std::uint64_t order;
    std::function<void()> action;
    bool background;
  };
  void schedule(RunTime when, std::function<void()> action, bool background);
  /// Advances the simulation on the calling thread until another task's turn comes, and passes the
  /// turn to it. Returns when it is self's turn again, or at once if `wait` is false.
  void dispatch(Task& self, bool wait);
  Task* next_task();
  std::string waiting() const;
  void unwind();

  RunTime now_{};
  std::uint64_t order_ = 0;
  std::vector<Event> events_;   ///< heap, earliest first
  std::size_t foreground_ = 0;  ///< events that are not background
  std::size_t running_ = 0;     ///< tasks that have not ended
  Task* ready_ = nullptr;
  Task main_;
  std::vector<std::unique_ptr<Task>> tasks_;
  std::vector<std::function<void()>> stuck_hooks_;
  std::exception_ptr error_;  ///< first exception that left an action or a task
  bool over_ = false;         ///< while true, tasks that are woken unwind
};

}  // namespace slambed
