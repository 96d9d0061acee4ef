// SPDX-License-Identifier: Apache-2.0
#include "runtime/virtual/virtual_runtime.hpp"

#include <algorithm>
#include <utility>

namespace slambed {

/// One wait of one task. The first wake-up counts; later ones are ignored.
struct VirtualSignal::Waiter {
  VirtualRuntime& runtime;
  Task& task;
  bool done = false;
  bool notified = false;

  void wake(bool by_signal) {
    if (std::exchange(done, true)) return;
    notified = by_signal;
    runtime.wake(task);
  }
};

void VirtualSignal::notify() {
  ++count_;
  for (auto& waiter : std::exchange(waiters_, {})) waiter->wake(true);
}

class VirtualRuntime::VirtualWorker final : public Worker {
 public:
  VirtualWorker(VirtualRuntime& runtime, std::string name)
      : runtime_(runtime), name_(std::move(name)) {}
  void attach(Task& task) { task_ = &task; }

  RunTime now() const override { return runtime_.now(); }
  bool wait(Signal& signal, std::uint64_t ticket, RunTime deadline) override {
    return runtime_.wait(*task_, &static_cast<VirtualSignal&>(signal), ticket, deadline);
  }
  void sleep_until(RunTime when) override { runtime_.wait(*task_, nullptr, 0, when); }
  bool stopping() const override { return runtime_.stopping_; }
  bool charged() const override { return true; }

 protected:
  StageToken begin_stage(std::string_view name) override {
    runtime_.model_.cost(name);  // throws here, since end_stage runs in a destructor
    return {name, now(), {}};
  }
  void end_stage(StageToken& token, const StageUnits& units) override {
    auto count = runtime_.executions_.try_emplace(std::string(token.name), 0).first;
    const Duration cost =
        runtime_.model_.charge(token.name, units, runtime_.seed_, count->second++);
    const std::string& on = runtime_.model_.cost(token.name).accelerator;
    (on.empty() ? runtime_.device_ : runtime_.accelerators_.at(on)).execute(*task_, cost);
    runtime_.observer_.stage({.name = token.name,
                              .worker = name_,
                              .start = token.start,
                              .wall = now() - token.start,
                              .cpu = on.empty() ? cost : Duration::zero(),
                              .units = units});
  }
  void end_stage_with(StageToken& token, const StageUnits& units,
                      const std::function<void()>& effect) override {
    end_stage(token, units);
    effect();
  }

 private:
  VirtualRuntime& runtime_;
  std::string name_;
  Task* task_ = nullptr;
};

VirtualRuntime::VirtualRuntime(Simulator& simulator, DeviceModel model, std::uint64_t seed,
                               Observer& observer)
    : simulator_(simulator),
      model_(std::move(model)),
      device_(simulator, model_.cores, model_.background),
      seed_(seed),
      observer_(observer) {
  model_.check();
  for (const auto& [name, accelerator] : model_.accelerators) {
    accelerators_.try_emplace(name, simulator, accelerator.lanes);
  }
  simulator_.on_stuck([this] { stop(); });
}

void VirtualRuntime::spawn(std::string name, std::function<void(Worker&)> body) {
  auto worker = std::make_shared<VirtualWorker>(*this, name);
  Task& task = simulator_.spawn(std::move(name), [this, worker, body = std::move(body)] {
    try {
      body(*worker);
    } catch (const SimulationOver&) {
      throw;
    } catch (...) {
      if (!error_) error_ = std::current_exception();
      stop();
      failed_();
    }
  });
  worker->attach(task);
}

void VirtualRuntime::stop() {
  stopping_ = true;
  for (auto& weak : std::exchange(waiting_, {})) {
    if (auto waiter = weak.lock()) waiter->wake(false);
  }
}

void VirtualRuntime::freeze(bool frozen) {
  frozen_ = frozen;
  device_.freeze(frozen);
  for (auto& [name, accelerator] : accelerators_) accelerator.freeze(frozen);
  if (frozen) return;
  for (Task* task : std::exchange(woken_, {})) simulator_.resume(*task);
}

void VirtualRuntime::wake(Task& task) {
  if (frozen_) {
    woken_.push_back(&task);
  } else {
    simulator_.resume(task);
  }
}

void VirtualRuntime::join() {
  if (auto error = std::exchange(error_, nullptr)) std::rethrow_exception(error);
}

bool VirtualRuntime::wait(Task& task, VirtualSignal* signal, std::uint64_t ticket,
                          RunTime deadline) {
  if (signal && signal->count_ != ticket) return true;
  if (stopping_ || deadline <= now()) return false;
  auto waiter = std::make_shared<VirtualSignal::Waiter>(VirtualSignal::Waiter{*this, task});
  if (signal) {
    std::erase_if(signal->waiters_, [](const auto& old) { return old->done; });
    signal->waiters_.push_back(waiter);
  }
  std::erase_if(waiting_, [](const auto& weak) { return weak.expired(); });
  waiting_.push_back(waiter);
  if (deadline != kNever) simulator_.at(deadline, [waiter] { waiter->wake(false); });
  task.suspend();
  return waiter->notified;
}

}  // namespace slambed
