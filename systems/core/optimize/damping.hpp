// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>

namespace slambed {

/// Damping factor of Levenberg-Marquardt with Nielsen's update (Madsen, Nielsen, Tingleff, "Methods
/// for non-linear least squares problems", 2004, section 3.2). It scales the diagonal of the normal
/// equations (Marquardt), so it has no unit.
class Damping {
 public:
  double value() const { return value_; }
  /// Returns the value to add to a diagonal entry. The minimum keeps the equations solvable for
  /// parameters without observations.
  double of(double diagonal) const { return value_ * std::max(diagonal, kMinDiagonal); }

  /// gain: decrease of the cost divided by the decrease that the linear model predicts.
  void accept(double gain) {
    const double g = 2 * gain - 1;
    value_ = std::max(kMin, value_ * std::max(1.0 / 3, 1 - g * g * g));
    growth_ = kFirstGrowth;
  }
  void reject() {
    value_ *= growth_;
    growth_ *= 2;
  }
  bool exhausted() const { return value_ > kMax; }

 private:
  static constexpr double kStart = 1e-4;  ///< Ceres' default; initial values are near the optimum
  static constexpr double kMin = 1e-9;    ///< keeps 3x3 point blocks invertible in double precision
  static constexpr double kMax = 1e12;
  static constexpr double kMinDiagonal = 1e-6;
  static constexpr double kFirstGrowth = 4;

  double value_ = kStart;
  double growth_ = kFirstGrowth;
};

/// Converged when the predicted decrease is below this share of the cost, which is rounding error.
inline constexpr double kRoundingShare = 1e-13;

}  // namespace slambed
