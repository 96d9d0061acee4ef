// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "link/stream.hpp"

namespace slambed::link {

/// Packet loss as a two-state Markov chain (Gilbert 1960, Elliott 1963); independent random loss is
/// the chain that never leaves the good state. The chain advances per packet, or in time where the
/// mean durations are given: then its states are a function of run time, whatever is sent.
/// Probabilities 0..1.
struct LossOptions {
  double to_bad = 0.0;        ///< good -> bad, per packet
  double to_good = 1.0;       ///< bad -> good, per packet
  double loss_good = 0.0;     ///< loss in the good state
  double loss_bad = 1.0;      ///< loss in the bad state
  double mean_good_ns = 0.0;  ///< in time: mean duration of the good state; 0: per packet
  double mean_bad_ns = 0.0;   ///< in time: mean duration of a burst

  bool in_time() const { return mean_bad_ns > 0; }
};

class LossModel {
 public:
  LossModel(const LossOptions& options, std::uint64_t seed, std::uint64_t direction,
            Lane lane = Lane::kData);

  /// Decides on the next packet. Depends on the number of packets of its lane before it (and, for a
  /// chain in time, on the time) and on nothing else: same seed, same drops.
  /// @param run_time_ns not decreasing; below 0 the run has not begun: no bursts in time
  bool drop(std::int64_t run_time_ns = 0);

 private:
  void advance(std::int64_t run_time_ns);

  LossOptions options_;
  SplitMix64 loss_;
  SplitMix64 state_;
  bool bad_ = false;
  double turns_ns_ = -1;  ///< in time: when the present state ends; below 0: not begun
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
  JitterModel(const JitterOptions& options, std::uint64_t seed, std::uint64_t direction,
              Lane lane = Lane::kData);

  /// May be negative (normal); the link never makes the total delay negative.
  std::int64_t draw(std::int64_t now_ns);

 private:
  double next_gaussian(std::int64_t now_ns);

  JitterOptions options_;
  SplitMix64 random_;
  std::optional<double> last_;
  std::int64_t last_ns_ = 0;
};

}  // namespace slambed::link
