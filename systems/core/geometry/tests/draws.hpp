// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

namespace slambed {

/// Returns a vector of draws. The last component is drawn first.
///
/// C++ leaves open in which order arguments are evaluated, such as the draws in `Vector2d(draw(),
/// draw())`. GCC begins with the last on x86-64 and with the first on arm64, so the inputs of a
/// test would depend on the processor. The limits of our tests were chosen on x86-64.
template <int Size, typename Draw>
Eigen::Matrix<double, Size, 1> drawn(Draw draw) {
  Eigen::Matrix<double, Size, 1> values;
  for (int i = Size - 1; i >= 0; --i) values[i] = draw();
  return values;
}

}  // namespace slambed
