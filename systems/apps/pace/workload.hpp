// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace slambed::pace {

/// The fixed workload for measuring speed: small versions of what SLAM spends its time on. Version
/// 1. It must not follow changes of the core, because another workload is another unit of speed.
///
/// One unit takes about 50 us on a server core: a smoothing pass with a threshold over some rows of
/// an image, nearest neighbors among binary descriptors, and a Cholesky factorization.
class Workload {
 public:
  Workload();

  /// Does one unit; equal numbers of units give equal checksums on every machine.
  void unit();

  std::uint64_t checksum() const { return checksum_; }

 private:
  void smooth();
  void match();
  void factor();

  std::vector<std::uint8_t> image_;
  std::vector<std::array<std::uint64_t, 4>> descriptors_;
  std::vector<double> matrix_;
  std::uint64_t checksum_ = 0;
  int turn_ = 0;
};

}  // namespace slambed::pace
