// SPDX-License-Identifier: Apache-2.0
#include "link/impairment.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/portable_math.hpp"

namespace slambed::link {

LossModel::LossModel(const LossOptions& options, std::uint64_t seed, std::uint64_t direction,
                     Lane lane)
    : options_(options),
      loss_(stream(seed, direction, Purpose::kLoss, lane)),
      // Bursts in time belong to the medium, so both lanes have the same.
      state_(stream(seed, direction, Purpose::kLossState, options.in_time() ? Lane::kData : lane)) {
}

void LossModel::advance(std::int64_t run_time_ns) {
  if (run_time_ns < 0) return;
  const auto lasts = [this] {
    return -(bad_ ? options_.mean_bad_ns : options_.mean_good_ns) *
           portable::log(1.0 - state_.uniform());
  };
  if (turns_ns_ < 0) {
    const double both = options_.mean_bad_ns + options_.mean_good_ns;
    bad_ = state_.uniform() * both < options_.mean_bad_ns;
    turns_ns_ = lasts();
  }
  while (turns_ns_ <= static_cast<double>(run_time_ns)) {
    bad_ = !bad_;
    turns_ns_ += lasts();
  }
}

bool LossModel::drop(std::int64_t run_time_ns) {
  if (options_.in_time()) advance(run_time_ns);
  const bool lost = loss_.uniform() < (bad_ ? options_.loss_bad : options_.loss_good);
  if (options_.in_time()) return lost;
  const double turn = state_.uniform();
  bad_ = bad_ ? turn >= options_.to_good : turn < options_.to_bad;
  return lost;
}

JitterModel::JitterModel(const JitterOptions& options, std::uint64_t seed, std::uint64_t direction,
                         Lane lane)
    : options_(options), random_(stream(seed, direction, Purpose::kJitter, lane)) {}

double JitterModel::next_gaussian(std::int64_t now_ns) {
  const double fresh = random_.normal();
  double rho = options_.correlation;
  if (options_.correlation_time_ns > 0.0) {
    rho = portable::exp(-static_cast<double>(now_ns - last_ns_) / options_.correlation_time_ns);
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
    // Maps the Gaussian's upper tail to a Lomax distribution (a Pareto shifted to start at 0) with
    // the configured mean.
    const double tail = 0.5 * portable::erfc(gaussian / std::numbers::sqrt2);
    const double lomax_scale = options_.scale_ns * (options_.pareto_shape - 1.0);
    extra_ns = lomax_scale * (portable::pow(tail, -1.0 / options_.pareto_shape) - 1.0);
  }
  if (options_.max_ns > 0.0) extra_ns = std::min(extra_ns, options_.max_ns);
  return static_cast<std::int64_t>(extra_ns);
}

}  // namespace slambed::link
