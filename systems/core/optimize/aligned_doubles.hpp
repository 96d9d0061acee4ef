// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace slambed {

/// Doubles aligned to a cache line, so that no aligned vector load crosses two lines.
class AlignedDoubles {
 public:
  /// New elements are zero.
  void resize(std::size_t count) { lines_.resize((count + kPerLine - 1) / kPerLine); }
  void fill(double value) { std::fill_n(data(), kPerLine * lines_.size(), value); }
  double* data() { return lines_.empty() ? nullptr : lines_.front().numbers; }
  const double* data() const { return lines_.empty() ? nullptr : lines_.front().numbers; }
  double& operator[](std::size_t i) { return data()[i]; }
  double operator[](std::size_t i) const { return data()[i]; }

 private:
  static constexpr std::size_t kPerLine = 8;
  struct alignas(64) Line {
    double numbers[kPerLine] = {};
  };
  std::vector<Line> lines_;
};

}  // namespace slambed
