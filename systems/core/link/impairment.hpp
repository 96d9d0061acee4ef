// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "link/stream.hpp"

namespace slambed::link {

/// Packet loss as a two-state Markov chain (Gilbert 1960, Elliott 1963). Independent random loss is
/// a chain that never leaves the good state. The chain advances per packet. If the mean durations
/// are given it advances in run time instead, whatever is sent. Probabilities are 0..1.
struct LossOptions {
  double to_bad = 0.0;        ///< good -> bad, per packet
  double to_good = 1.0;       ///< bad -> good, per packet
  double loss_good = 0.0;     ///< loss in the good state
  double loss_bad = 1.0;      ///< loss in the bad state
  double mean_good_ns = 0.0;  ///< chain in time: mean duration of the good state; 0: per packet
  double mean_bad_ns = 0.0;   ///< chain in time: mean duration of a burst

  bool in_time() const { return mean_bad_ns > 0; }
};

class LossModel {
 public:
  LossModel(const LossOptions& options, std::uint64_t seed, std::uint64_t direction,
            Lane lane = Lane::kData);

  /// Returns whether the next packet is dropped. For a given seed this depends only on the number
  /// of packets before it in its lane and, with a chain in time, on the time.
  /// @param run_time_ns not decreasing; bursts in time start at 0
  bool drop(std::int64_t run_time_ns = 0);

 private:
  void advance(std::int64_t run_time_ns);

  LossOptions options_;
  SplitMix64 loss_;
  SplitMix64 state_;
  bool bad_ = false;
  double turns_ns_ = -1;  ///< chain in time: when the current state ends; below 0: not started
};

enum class JitterShape { kNormal, kPareto };

struct JitterOptions {
  JitterShape shape = JitterShape::kNormal;
  double scale_ns = 0.0;           ///< normal: standard deviation; Pareto: mean
  double pareto_shape = 3.0;       ///< tail index, above 1
  double max_ns = 0.0;             ///< larger values are clipped to this; 0 = no limit
  double correlation = 0.0;        ///< between successive packets, 0..1 (as netem's)
  double correlation_time_ns = 0;  ///< correlation by time instead: exp(-dt / this); 0 = off
};

/// Extra delay per packet: a first-order autoregressive Gaussian that is mapped to the configured
/// distribution, so that correlation does not change the distribution (as it does in netem).
class JitterModel {
 public:
  JitterModel(const JitterOptions& options, std::uint64_t seed, std::uint64_t direction,
              Lane lane = Lane::kData);

  /// May be negative with the normal shape. The link clips the sum with the profile's delay at 0.
  std::int64_t draw(std::int64_t now_ns);

 private:
  double next_gaussian(std::int64_t now_ns);

  JitterOptions options_;
  SplitMix64 random_;
  std::optional<double> last_;
  std::int64_t last_ns_ = 0;
};

}  // namespace slambed::link
