// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <string_view>

#include "runtime/cost_model.hpp"
#include "runtime/observer.hpp"

namespace slambed {

/// Time that the calling thread has had of a CPU.
Duration thread_cpu_time();
/// Computes for nothing until the calling thread has had this much of a CPU, or nobody wants it any
/// more.
void burn_until(Duration thread_cpu, const std::function<bool()>& over);

struct PaceOptions {
  DeviceModel device;
  double share = 1;  ///< of a CPU of this host that one core of the device is: a thread's quota
  std::uint64_t seed = 0;
};

/// Makes the stages of live workers take what a device's cost model charges for them, jitter
/// included. A stage of d seconds has had `share * d` of a CPU and ends d after its begin, not
/// before: what the work itself left of the CPU time is burnt, what the quota then leaves of d is
/// slept. So the quota slows a stage to the device's speed once, and neither its period nor the
/// host's speed shows; who waits for a CPU, or is held back for what other threads took of the
/// node's quota, ends later.
///
/// What an accelerator does burns nothing. Its lanes are not shared: each piece takes its time.
class Pace {
 public:
  /// Throws Error(kBadInput) for a model or a share that cannot be.
  explicit Pace(PaceOptions options);

  /// Throws Error(kBadInput) for a stage that has no cost.
  void check(std::string_view stage) const { options_.device.cost(stage); }
  /// When a stage began: on the wall clock that `sleep_until` means, and of its thread.
  struct Begin {
    RunTime start{};
    Duration cpu{};
  };
  struct Surroundings {
    std::function<RunTime()> now;
    std::function<void(RunTime)> sleep_until;  ///< returns early once the run stops
    std::function<bool()> stopping;
  };
  /// On the thread of the stage, whose work is done: returns when the device would be done.
  PacedStage hold(std::string_view stage, const StageUnits& units, const Begin& begin,
                  const Surroundings& around);

 private:
  Duration charge(std::string_view stage, const StageUnits& units);

  PaceOptions options_;
  std::mutex mutex_;                                              ///< guards what follows
  std::map<std::string, std::uint64_t, std::less<>> executions_;  ///< per stage
};

}  // namespace slambed
