// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "base/time.hpp"

namespace slambed {

/// Sizes of one piece of work, for the cost model a + b*n1 + c*n2.
struct StageUnits {
  double n1 = 0, n2 = 0;
};

/// Wakes workers. A worker takes a ticket, checks the state that it waits for, then waits with the
/// ticket, so that a notify in between is not lost.
class Signal {
 public:
  virtual ~Signal() = default;
  virtual std::uint64_t ticket() const = 0;
  virtual void notify() = 0;
};

/// Time passes for a worker only in wait, sleep_until and stage. Live workers are threads; virtual
/// ones take turns under a discrete-event clock. Worker code is the same for both.
class Worker {
 public:
  virtual ~Worker() = default;
  virtual RunTime now() const = 0;
  /// Returns true when notified after the ticket, false at the deadline or when the run stops.
  virtual bool wait(Signal& signal, std::uint64_t ticket, RunTime deadline) = 0;
  virtual void sleep_until(RunTime when) = 0;
  /// True once the run is being shut down; loops end then.
  virtual bool stopping() const = 0;
  /// True in virtual time, where a cost model alone decides how long a stage takes.
  virtual bool charged() const = 0;

  /// Runs work(StageUnits&) as the named stage: measured when live, charged when virtual, and
  /// recorded as a stage event either way. Work must not wait.
  template <typename Work>
  auto stage(std::string_view name, Work&& work) {
    StageUnits units;
    StageToken token = begin_stage(name);
    struct Finish {
      Worker& worker;
      StageToken& token;
      StageUnits& units;
      ~Finish() { worker.end_stage(token, units); }
    } finish{*this, token, units};
    return work(units);
  }

  /// The same for work whose result others may see only at the end of the stage: effect(result)
  /// runs after the charged time has passed. A live measurement and a virtual charge cover both.
  template <typename Work, typename Effect>
  void stage(std::string_view name, Work&& work, Effect&& effect) {
    StageUnits units;
    StageToken token = begin_stage(name);
    const auto result = work(units);
    end_stage_with(token, units, [&] { effect(result); });
  }

 protected:
  struct StageToken {
    std::string_view name;
    RunTime start{};
    Duration cpu_start{};
  };
  virtual StageToken begin_stage(std::string_view name) = 0;
  virtual void end_stage(StageToken& token, const StageUnits& units) = 0;
  virtual void end_stage_with(StageToken& token, const StageUnits& units,
                              const std::function<void()>& effect) = 0;
};

/// Clock, workers and signals of one node, implemented in live/ and virtual/.
class Runtime {
 public:
  virtual ~Runtime() = default;
  virtual RunTime now() const = 0;
  virtual std::unique_ptr<Signal> make_signal() = 0;
  /// Starts a worker. The first exception that leaves a worker stops the run; join rethrows it.
  virtual void spawn(std::string name, std::function<void(Worker&)> body) = 0;
  virtual void stop() = 0;  ///< asks all workers to end
  virtual void join() = 0;  ///< waits until all have
};

}  // namespace slambed
