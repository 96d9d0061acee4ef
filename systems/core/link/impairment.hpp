// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "link/random.hpp"

namespace slambed::link {

/// Loss as a two-state Markov chain per packet (Gilbert 1960, Elliott 1963); independent random
/// loss is the chain that never leaves the good state. Probabilities 0..1.
struct LossOptions {
  double to_bad = 0.0;     ///< good -> bad, per packet
  double to_good = 1.0;    ///< bad -> good, per packet
  double loss_good = 0.0;  ///< loss in the good state
  double loss_bad = 1.0;   ///< loss in the bad state
};

class LossModel {
 public:
  LossModel(const LossOptions& options, std::uint64_t seed, std::uint64_t direction);

  /// Decides on the next packet. Depends on the number of packets before it and on nothing else:
  /// same seed, same drops.
  bool drop();

 private:
  LossOptions options_;
  Random loss_;
  Random state_;
  bool bad_ = false;
};

enum class JitterShape { kNormal, kPareto };

struct JitterOptions {
  JitterShape shape = JitterShape::kNormal;
  double scale_ns = 0.0;           ///< normal: standard deviation; Pareto: mean
  double pareto_shape = 3.0;       ///< tail index, above 1
  double max_ns = 0.0;             ///< cut above this; 0 = never
  double correlation = 0.0;        ///< between successive packets, 0..1 (as netem's)
  double correlation_time_ns = 0;  ///< correlation by time instead: exp(-dt / this); 0 = off
};

/// Extra delay per packet: a first-order autoregressive Gaussian, mapped to the asked distribution,
/// so that correlation does not change the distribution (netem's does).
class JitterModel {
 public:
  JitterModel(const JitterOptions& options, std::uint64_t seed, std::uint64_t direction);

  /// May be negative (normal); the link never makes the total delay negative.
  std::int64_t draw(std::int64_t now_ns);

 private:
  double next_gaussian(std::int64_t now_ns);

  JitterOptions options_;
  Random random_;
  std::optional<double> last_;
  std::int64_t last_ns_ = 0;
};

}  // namespace slambed::link
