// SPDX-License-Identifier: Apache-2.0
/// Drawn statistics are within 3 standard errors of the configured ones. The seeds are fixed, so
/// the result does not vary.
#include "link/impairment.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace slambed::link {
namespace {

constexpr double kMsInNs = 1e6;

TEST(Loss, RandomLossHasTheAskedShare) {
  constexpr int kPackets = 200'000;
  constexpr double kShare = 0.02;
  LossModel model({.loss_good = kShare}, 11, 0);
  int lost = 0;
  for (int i = 0; i < kPackets; ++i) lost += model.drop();
  EXPECT_NEAR(lost, kPackets * kShare, 3 * std::sqrt(kPackets * kShare * (1 - kShare)));
}

TEST(Loss, GilbertElliottHasTheAskedShareAndBurstLength) {
  constexpr int kPackets = 500'000;
  const LossOptions options{.to_bad = 0.01, .to_good = 0.25, .loss_good = 0.0, .loss_bad = 1.0};
  LossModel model(options, 5, 0);
  int lost = 0, bursts = 0;
  bool before = false;
  for (int i = 0; i < kPackets; ++i) {
    const bool now = model.drop();
    lost += now;
    bursts += now && !before;
    before = now;
  }
  const double share = options.to_bad / (options.to_bad + options.to_good);
  // Variance of the count of a two-state chain: p(1-p) n (1+r)/(1-r), r = 1 - to_bad - to_good.
  const double r = 1 - options.to_bad - options.to_good;
  const double sigma = std::sqrt(kPackets * share * (1 - share) * (1 + r) / (1 - r));
  EXPECT_NEAR(lost, kPackets * share, 3 * sigma);
  // Burst lengths are geometric: mean 1/to_good, standard deviation sqrt(1-to_good)/to_good.
  const double spread = std::sqrt(1 - options.to_good) / options.to_good / std::sqrt(bursts);
  EXPECT_NEAR(static_cast<double>(lost) / bursts, 1 / options.to_good, 3 * spread);
}

struct Moments {
  double mean, deviation, lag1;
};

Moments moments(JitterModel model, int count, std::int64_t step_ns) {
  std::vector<double> values;
  for (int i = 0; i < count; ++i)
    values.push_back(static_cast<double>(model.draw(i * step_ns)) / kMsInNs);
  double mean = 0, square = 0, cross = 0;
  for (const double value : values) mean += value / count;
  for (const double value : values) square += (value - mean) * (value - mean) / count;
  for (std::size_t i = 1; i < values.size(); ++i) {
    cross += (values[i] - mean) * (values[i - 1] - mean) / count;
  }
  return {mean, std::sqrt(square), cross / square};
}

TEST(Jitter, NormalHasTheAskedMeanAndDeviation) {
  constexpr int kPackets = 100'000;
  const auto m = moments(JitterModel({.scale_ns = 2 * kMsInNs}, 1, 0), kPackets, 1000);
  EXPECT_NEAR(m.mean, 0.0, 3 * 2.0 / std::sqrt(kPackets));
  EXPECT_NEAR(m.deviation, 2.0, 3 * 2.0 / std::sqrt(2.0 * kPackets));
  EXPECT_NEAR(m.lag1, 0.0, 3 / std::sqrt(kPackets));
}

TEST(Jitter, CorrelationDoesNotChangeTheDeviation) {
  constexpr int kPackets = 100'000;
  constexpr double kRho = 0.8;
  const auto m =
      moments(JitterModel({.scale_ns = 2 * kMsInNs, .correlation = kRho}, 2, 0), kPackets, 1000);
  // An AR(1) series counts as n (1-r)/(1+r) independent values for the mean, (1-r^2)/(1+r^2) for
  // the variance.
  const double for_mean = kPackets * (1 - kRho) / (1 + kRho);
  const double for_variance = kPackets * (1 - kRho * kRho) / (1 + kRho * kRho);
  EXPECT_NEAR(m.mean, 0.0, 3 * 2.0 / std::sqrt(for_mean));
  EXPECT_NEAR(m.deviation, 2.0, 3 * 2.0 / std::sqrt(2.0 * for_variance));
  EXPECT_NEAR(m.lag1, kRho, 3 * std::sqrt((1 - kRho * kRho) / kPackets));
}

TEST(Jitter, CorrelationByTimeDependsOnTheGapBetweenPackets) {
  constexpr int kPackets = 100'000;
  const JitterOptions options{.scale_ns = 1 * kMsInNs, .correlation_time_ns = 50 * kMsInNs};
  const auto dense = moments(JitterModel(options, 3, 0), kPackets, 5'000'000);
  const auto sparse = moments(JitterModel(options, 3, 0), kPackets, 200'000'000);
  const double rho = std::exp(-0.1);
  EXPECT_NEAR(dense.lag1, rho, 3 * std::sqrt((1 - rho * rho) / kPackets) + 1e-3);
  EXPECT_NEAR(sparse.lag1, std::exp(-4.0), 3 / std::sqrt(kPackets));
}

TEST(Jitter, ParetoHasTheAskedMeanAndIsNeverNegative) {
  constexpr int kPackets = 200'000;
  JitterModel model({.shape = JitterShape::kPareto, .scale_ns = 4 * kMsInNs, .pareto_shape = 5}, 4,
                    0);
  double sum = 0;
  for (int i = 0; i < kPackets; ++i) {
    const auto value = static_cast<double>(model.draw(i)) / kMsInNs;
    ASSERT_GE(value, 0.0);
    sum += value;
  }
  // Lomax, tail a: deviation = mean * sqrt(a / (a-2)).
  const double deviation = 4.0 * std::sqrt(5.0 / 3.0);
  EXPECT_NEAR(sum / kPackets, 4.0, 3 * deviation / std::sqrt(kPackets));
}

TEST(Jitter, IsCutAtItsMaximum) {
  JitterModel model({.shape = JitterShape::kPareto,
                     .scale_ns = 4 * kMsInNs,
                     .pareto_shape = 1.5,
                     .max_ns = 10 * kMsInNs},
                    4, 0);
  std::int64_t largest = 0;
  for (int i = 0; i < 10'000; ++i) largest = std::max(largest, model.draw(i));
  EXPECT_EQ(largest, static_cast<std::int64_t>(10 * kMsInNs));
}

/// FNV-1a over all draws. The large scale makes differences in the last bits of a draw visible.
std::uint64_t digest(JitterOptions options) {
  options.scale_ns = 1e14;
  JitterModel model(options, 7, 1);
  std::uint64_t hash = 0xCBF29CE484222325u;
  for (std::int64_t i = 0; i < 50'000; ++i) {
    hash = (hash ^ static_cast<std::uint64_t>(model.draw(i * 1'000'000))) * 0x100000001B3u;
  }
  return hash;
}

TEST(SameBits, OfJitter) {
  EXPECT_EQ(digest({.shape = JitterShape::kNormal, .correlation_time_ns = 3e6}),
            15259544315735810191u);
  EXPECT_EQ(digest({.shape = JitterShape::kPareto, .pareto_shape = 2.5}), 17751160885375415565u);
}

}  // namespace
}  // namespace slambed::link
