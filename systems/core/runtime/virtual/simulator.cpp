// SPDX-License-Identifier: Apache-2.0
#include "runtime/virtual/simulator.hpp"

#include <algorithm>
#include <utility>

#include "base/error.hpp"

namespace slambed {
namespace {

constexpr auto kLater = [](const auto& a, const auto& b) {
  return std::pair(a.time, a.order) > std::pair(b.time, b.order);
};

}  // namespace

void Task::suspend() {
  if (!simulator_.over_) simulator_.dispatch(*this, true);
  // Not a std::exception, so that no handler of a system catches it.
  if (simulator_.over_) throw SimulationOver();  // NOLINT(bugprone-std-exception-baseclass)
}

Simulator::Simulator() : main_(*this, "simulator") {}

Simulator::~Simulator() { unwind(); }

void Simulator::schedule(RunTime when, std::function<void()> action, bool background) {
  events_.push_back({std::max(when, now_), order_++, std::move(action), background});
  foreground_ += background ? 0 : 1;
  std::push_heap(events_.begin(), events_.end(), kLater);
}

Task& Simulator::spawn(std::string name, std::function<void()> body) {
  tasks_.push_back(std::make_unique<Task>(*this, std::move(name)));
  Task& task = *tasks_.back();
  task.thread_ = std::thread([this, &task, body = std::move(body)] {
    task.turn_.acquire();
    try {
      if (!over_) body();
    } catch (const SimulationOver&) {
    } catch (...) {
      if (!error_) error_ = std::current_exception();
    }
    task.finished_ = true;
    --running_;
    if (!over_) dispatch(task, false);
  });
  ++running_;
  resume(task);
  return task;
}

void Simulator::resume(Task& task) {
  at(now_, [this, &task] { ready_ = &task; });
}

Task* Simulator::next_task() {
  while (running_ > 0 && foreground_ > 0 && !error_) {
    std::pop_heap(events_.begin(), events_.end(), kLater);
    Event event = std::move(events_.back());
    events_.pop_back();
    foreground_ -= event.background ? 0 : 1;
    now_ = event.time;
    try {
      event.action();
    } catch (...) {
      // The exception belongs to the run, not to the task on whose thread the action ran.
      error_ = std::current_exception();
    }
    if (ready_) return std::exchange(ready_, nullptr);
  }
  return &main_;
}

void Simulator::dispatch(Task& self, bool wait) {
  Task* next = next_task();
  if (next == &self) return;
  next->turn_.release();
  if (wait) self.turn_.acquire();
}

std::string Simulator::waiting() const {
  std::string names;
  for (const auto& task : tasks_) {
    if (!task->finished_) names += (names.empty() ? "" : ", ") + task->name();
  }
  return names;
}

void Simulator::unwind() {
  over_ = true;
  for (auto& task : tasks_) {
    if (!task->thread_.joinable()) continue;
    if (!task->finished_) task->turn_.release();
    task->thread_.join();
  }
  over_ = false;
}

void Simulator::run() {
  dispatch(main_, true);
  const std::string stuck = waiting();
  // Workers that end may wake others that then wait again. The second round ends those too.
  for (int round = 0; round < 2 && !error_ && !waiting().empty(); ++round) {
    for (auto& hook : stuck_hooks_) hook();
    dispatch(main_, true);
  }
  unwind();
  if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
  if (!stuck.empty()) {
    throw Error(ExitCode::kInternal, "virtual run: nothing left to happen at " +
                                         std::to_string(to_seconds(now_)) + " s, but " + stuck +
                                         " still waited");
  }
}

}  // namespace slambed
