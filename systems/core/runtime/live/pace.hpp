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

Duration thread_cpu_time();
/// Spins until the calling thread has used this much CPU time or over() returns true.
void burn_until(Duration thread_cpu, const std::function<bool()>& over);

struct PaceOptions {
  DeviceModel device;
  double share = 1;  ///< one core of the device as a share of a CPU of this host (CPU quota)
  std::uint64_t seed = 0;
};

/// Makes the stages of live workers take the time that a device's cost model charges, jitter
/// included. A stage of d seconds uses `share * d` of CPU time and does not end before d after its
/// start. The CPU time that the work did not use is burned, then the rest of d is slept. Neither
/// the period of the CPU quota nor the host's speed influences the duration. A stage that waits for
/// a CPU, or is throttled because other threads used up the node's quota, ends later.
///
/// Accelerator stages burn no CPU time. Contention for their lanes is not modeled.
class Pace {
 public:
  /// Throws Error(kBadInput) for an invalid model or share.
  explicit Pace(PaceOptions options);

  /// Throws Error(kBadInput) for a stage that has no cost.
  void check(std::string_view stage) const { options_.device.cost(stage); }
  /// When a stage started: on the clock of `sleep_until`, and in CPU time of its thread.
  struct Begin {
    RunTime start{};
    Duration cpu{};
  };
  struct Surroundings {
    std::function<RunTime()> now;
    std::function<void(RunTime)> sleep_until;  ///< returns early once the run stops
    std::function<bool()> stopping;
  };
  /// Call on the stage's thread after its work. Returns when the device would be done.
  PacedStage hold(std::string_view stage, const StageUnits& units, const Begin& begin,
                  const Surroundings& around);

 private:
  Duration charge(std::string_view stage, const StageUnits& units);

  PaceOptions options_;
  std::mutex mutex_;                                              ///< guards what follows
  std::map<std::string, std::uint64_t, std::less<>> executions_;  ///< per stage
};

}  // namespace slambed
