// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <list>

#include "base/time.hpp"
#include "runtime/virtual/simulator.hpp"

namespace slambed {

/// The processor of a node: its cores are shared equally among the stages that run, as a fair
/// scheduler does; one stage never gets more than one core. A background load of some cores is
/// there all the time, as so many threads (rounded up) that each want an equal part of it.
class Device {
 public:
  Device(Simulator& simulator, int cores, double background = 0)
      : simulator_(simulator), cores_(cores), background_(background) {}

  /// Keeps the task busy for the given amount of undisturbed compute time.
  void execute(Task& task, Duration work);
  /// Frozen, no stage gets on; each goes on where it was once thawed.
  void freeze(bool frozen);
  /// Compute time spent so far, over all cores, that of the background load included.
  Duration cpu_time() const;

 private:
  struct Job {
    Task* task;
    double remaining_ns;
  };
  double rate() const;
  /// What the background load gets, in cores.
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
  std::uint64_t plan_ = 0;  ///< completions planned before the jobs changed are void
};

}  // namespace slambed
