// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

namespace slambed::cloudslam {

enum class StrategyKind { kAll, kPeriodic, kDistance, kAdaptive, kNone };

struct StrategyOptions {
  StrategyKind kind;
  double period_s;
  double distance_m;              ///< adaptive: initial value
  double correction_threshold_m;  ///< adaptive: tau, the error that the user tolerates
  double decrease, increase;
  double distance_min_m, distance_max_m;
};

/// A keyframe as the strategies see it.
struct Moment {
  double seq_s = 0;
  double traveled_m = 0;  ///< length of the tracked path until then
};

struct StrategyState {
  std::optional<Moment> last_sent;
  double distance_m = 0;  ///< X in the paper
};

/// Chooses the keyframes that are sent to the edge (section V of the paper). Pure: the same state
/// and keyframe give the same answer. Whoever sends one calls sent().
class Strategy {
 public:
  /// Throws bad_input for a strategy whose parameters are missing or invalid.
  explicit Strategy(const StrategyOptions& options);

  StrategyState begin() const { return {std::nullopt, options_.distance_m}; }
  /// Returns whether this new keyframe is to be sent. A period is a maximum rate, not a clock: the
  /// first keyframe after it is sent.
  bool next(const StrategyState& state, const Moment& keyframe) const;
  static StrategyState sent(StrategyState state, const Moment& keyframe);
  /// The edge's pose arrived, this far from ours.
  StrategyState answered(StrategyState state, double magnitude_m) const;
  bool adapts() const { return options_.kind == StrategyKind::kAdaptive; }

 private:
  StrategyOptions options_;
};

}  // namespace slambed::cloudslam
