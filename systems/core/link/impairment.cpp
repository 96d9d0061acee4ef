// SPDX-License-Identifier: Apache-2.0
#include "link/impairment.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace slambed::link {

LossModel::LossModel(const LossOptions& options, std::uint64_t seed, std::uint64_t direction)
    : options_(options),
      loss_(seed, direction, Stream::kLoss),
      state_(seed, direction, Stream::kLossState) {}

bool LossModel::drop() {
  const bool lost = loss_.uniform() < (bad_ ? options_.loss_bad : options_.loss_good);
  const double turn = state_.uniform();
  bad_ = bad_ ? turn >= options_.to_good : turn < options_.to_bad;
  return lost;
}

JitterModel::JitterModel(const JitterOptions& options, std::uint64_t seed, std::uint64_t direction)
    : options_(options), random_(seed, direction, Stream::kJitter) {}

double JitterModel::next_gaussian(std::int64_t now_ns) {
  const double fresh = random_.normal();
  double rho = options_.correlation;
  if (options_.correlation_time_ns > 0.0) {
    rho = std::exp(-static_cast<double>(now_ns - last_ns_) / options_.correlation_time_ns);
  }
  const double value = last_ ? rho * *last_ + std::sqrt(1.0 - rho * rho) * fresh : fresh;
  last_ = value;
  last_ns_ = now_ns;
  return value;
}

std::int64_t JitterModel::draw(std::int64_t now_ns) {
  const double gaussian = next_gaussian(now_ns);
  double extra_ns = options_.scale_ns * gaussian;
  if (options_.shape == JitterShape::kPareto) {
    // Lomax (Pareto shifted to start at 0) with the asked mean, through the Gaussian's upper tail.
    const double tail = 0.5 * std::erfc(gaussian / std::numbers::sqrt2);
    const double lomax_scale = options_.scale_ns * (options_.pareto_shape - 1.0);
    extra_ns = lomax_scale * (std::pow(tail, -1.0 / options_.pareto_shape) - 1.0);
  }
  if (options_.max_ns > 0.0) extra_ns = std::min(extra_ns, options_.max_ns);
  return static_cast<std::int64_t>(extra_ns);
}

}  // namespace slambed::link
