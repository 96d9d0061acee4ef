// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <exception>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "runtime/cost_model.hpp"
#include "runtime/observer.hpp"
#include "runtime/runtime.hpp"
#include "runtime/virtual/device.hpp"
#include "runtime/virtual/simulator.hpp"

namespace slambed {

/// A signal whose notify wakes its waiters at the current time, in the order of their arrival.
class VirtualSignal final : public Signal {
 public:
  std::uint64_t ticket() const override { return count_; }
  void notify() override;

 private:
  friend class VirtualRuntime;
  struct Waiter;
  std::uint64_t count_ = 0;
  std::vector<std::shared_ptr<Waiter>> waiters_;
};

/// One node of a virtual run: its workers take turns under the simulator's clock and every stage is
/// charged to the node's device.
class VirtualRuntime final : public Runtime {
 public:
  VirtualRuntime(Simulator& simulator, DeviceModel model, std::uint64_t seed, Observer& observer);

  RunTime now() const override { return simulator_.now(); }
  std::unique_ptr<Signal> make_signal() override { return std::make_unique<VirtualSignal>(); }
  void spawn(std::string name, std::function<void(Worker&)> body) override;
  void stop() override;
  /// After Simulator::run: rethrows the first exception that left a worker.
  void join() override;

  /// Acts like SIGSTOP and SIGCONT: workers stop even within a stage, and wake-ups take effect when
  /// they resume.
  void freeze(bool frozen);

  /// Sets a hook that is called when an exception leaves a worker, so that the other node does not
  /// wait forever for this one.
  void on_failure(std::function<void()> hook) { failed_ = std::move(hook); }

  /// Compute time of the cores so far, including the background load.
  Duration cpu_time() const { return device_.cpu_time(); }

 private:
  class VirtualWorker;
  friend struct VirtualSignal::Waiter;
  void wake(Task& task);
  bool wait(Task& task, VirtualSignal* signal, std::uint64_t ticket, RunTime deadline);

  Simulator& simulator_;
  DeviceModel model_;
  Device device_;
  std::map<std::string, Device, std::less<>> accelerators_;
  std::uint64_t seed_;
  Observer& observer_;
  bool stopping_ = false;
  bool frozen_ = false;
  std::vector<Task*> woken_;  ///< tasks woken while frozen
  std::exception_ptr error_;
  std::function<void()> failed_ = [] {};
  std::vector<std::weak_ptr<VirtualSignal::Waiter>> waiting_;
  std::map<std::string, std::uint64_t, std::less<>> executions_;  ///< per stage
};

}  // namespace slambed
