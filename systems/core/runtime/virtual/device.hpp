// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <list>

#include "base/time.hpp"
#include "runtime/virtual/simulator.hpp"

namespace slambed {

/// The processor of a node. Its cores are shared equally among the running stages, as by a fair
/// scheduler, and a stage gets at most one core. A constant background load of `background` cores
/// competes as ceil(background) threads that share it equally.
class Device {
 public:
  Device(Simulator& simulator, int cores, double background = 0)
      : simulator_(simulator), cores_(cores), background_(background) {}

  /// Suspends the task until it has had the given compute time on a core.
  void execute(Task& task, Duration work);
  /// While frozen, no stage progresses.
  void freeze(bool frozen);
  /// Compute time spent so far on all cores, including the background load.
  Duration cpu_time() const;

 private:
  struct Job {
    Task* task;
    double remaining_ns;
  };
  double rate() const;
  /// Cores that the background load gets.
  double background_rate() const;
  void advance();
  void plan();

  Simulator& simulator_;
  int cores_;
  double background_;
  bool frozen_ = false;
  std::list<Job> jobs_;
  RunTime updated_{};
  double spent_ns_ = 0;
  std::uint64_t plan_ = 0;  ///< number of the latest plan; events of older ones do nothing
};

}  // namespace slambed
