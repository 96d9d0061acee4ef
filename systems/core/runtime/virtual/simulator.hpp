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

/// Thrown into a task whose simulation is over: it is to unwind, nothing will ever wake it.
struct SimulationOver {};

/// A cooperative thread of the simulation: exactly one task (or the simulator itself) runs at a
/// time, so that code written for threads runs repeatably without being rewritten as coroutines.
class Task {
 public:
  Task(Simulator& simulator, std::string name) : simulator_(simulator), name_(std::move(name)) {}
  const std::string& name() const { return name_; }

  /// Gives way until somebody calls Simulator::resume for this task. On the task's own thread only.
  /// Throws SimulationOver when that will not happen any more.
  void suspend();

 private:
  friend class Simulator;
  Simulator& simulator_;
  std::string name_;
  std::binary_semaphore turn_{0};
  std::thread thread_;
  bool finished_ = false;
};

/// Discrete-event scheduler. Events of equal time run in the order in which they were asked for,
/// so a run depends on nothing but its inputs.
class Simulator {
 public:
  Simulator();
  /// Tasks that never started are dropped without a call.
  ~Simulator();
  Simulator(const Simulator&) = delete;
  Simulator& operator=(const Simulator&) = delete;

  RunTime now() const { return now_; }
  /// Runs the action at the given time, not before now. Actions must not suspend.
  void at(RunTime when, std::function<void()> action) { schedule(when, std::move(action), false); }
  /// The same for an observer: such events alone do not keep a run going.
  void at_background(RunTime when, std::function<void()> action) {
    schedule(when, std::move(action), true);
  }
  /// Creates a task that starts at the current time.
  Task& spawn(std::string name, std::function<void()> body);
  /// Lets a suspended task go on at the current time.
  void resume(Task& task);
  /// Called when no event is left but tasks still wait; must make them end (it may be called
  /// twice).
  void on_stuck(std::function<void()> hook) { stuck_hooks_.push_back(std::move(hook)); }

  /// Runs until every task has ended. Throws Error(kInternal) naming the waiting tasks when the
  /// simulation was stuck, and what an action or a task threw. However it ends, no task is left:
  /// those that would not end are unwound while all that they refer to is still there.
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
  /// Advances the simulation on the calling thread until another task's turn comes and passes the
  /// turn on; returns when the turn is self's again (or, with wait false, at once).
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
  std::exception_ptr error_;  ///< first that left an action or a task
  bool over_ = false;         ///< tasks that are woken now unwind
};

}  // namespace slambed
