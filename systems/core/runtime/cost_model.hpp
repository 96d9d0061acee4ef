// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "base/time.hpp"
#include "runtime/runtime.hpp"

namespace slambed {

/// Cost of one stage on the reference machine: (a + b*n1 + c*n2) microseconds, times a log-normal
/// factor of median 1.
struct StageCost {
  double a_us = 0, b_us = 0, c_us = 0;
  double jitter = 0;          ///< standard deviation of the factor's logarithm
  std::string accelerator{};  ///< the accelerator that does this work; empty: a core
};

/// A compute unit other than the cores (a GPU, a hardware feature extractor).
struct Accelerator {
  int lanes = 1;     ///< jobs that run at the same time, each at full speed
  double speed = 1;  ///< relative to the machine on which its stages' costs were measured
};

/// The cost model of a device, fitted by `slambed calibrate --stages`.
struct DeviceModel {
  int cores = 1;
  double speed = 1;       ///< relative to the reference machine
  double background = 0;  ///< cores that programs outside the system keep busy
  std::map<std::string, StageCost, std::less<>> stages;
  std::map<std::string, Accelerator, std::less<>> accelerators;

  /// Throws Error(kBadInput) for values that are negative or not finite.
  void check() const;
  /// Throws Error(kBadInput) for a stage that has no cost.
  const StageCost& cost(std::string_view stage) const;
  /// Returns the duration of one execution. Its jitter depends only on seed, stage and count, so
  /// runs that differ in one decision stay comparable elsewhere.
  Duration charge(std::string_view stage, const StageUnits& units, std::uint64_t seed,
                  std::uint64_t count) const;
};

}  // namespace slambed
