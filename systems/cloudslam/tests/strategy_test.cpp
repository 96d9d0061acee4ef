// SPDX-License-Identifier: Apache-2.0
#include "cloudslam/strategy.hpp"

#include <gtest/gtest.h>

#include <vector>

#include "base/error.hpp"

namespace slambed::cloudslam {
namespace {

StrategyOptions options_of(StrategyKind kind, double period_s = 5, double distance_m = 20) {
  return {.kind = kind,
          .period_s = period_s,
          .distance_m = distance_m,
          .correction_threshold_m = 2,
          .decrease = 0.9,
          .increase = 1.01,
          .distance_min_m = 1,
          .distance_max_m = 500};
}

StrategyOptions by_distance(StrategyKind kind, double distance_m) {
  return options_of(kind, 5, distance_m);
}

/// Times of the keyframes that are sent.
std::vector<double> sent_at(const StrategyOptions& options, const std::vector<Moment>& keyframes) {
  const Strategy strategy(options);
  StrategyState state = strategy.begin();
  std::vector<double> sent;
  for (const Moment& keyframe : keyframes) {
    if (!strategy.next(state, keyframe)) continue;
    state = Strategy::sent(state, keyframe);
    sent.push_back(keyframe.seq_s);
  }
  return sent;
}

std::vector<Moment> driven(const std::vector<double>& times, double m_per_s = 1) {
  std::vector<Moment> moments;
  for (const double t : times) moments.push_back({t, m_per_s * t});
  return moments;
}

TEST(Strategy, APeriodIsAMaximumRate) {
  const auto keyframes = driven({0, 0.4, 0.9, 1.0, 1.9, 2.1});
  EXPECT_EQ(sent_at(options_of(StrategyKind::kPeriodic, 1), keyframes),
            (std::vector<double>{0, 1.0, 2.1}));
  EXPECT_EQ(sent_at(options_of(StrategyKind::kAll), keyframes).size(), keyframes.size());
  EXPECT_TRUE(sent_at(options_of(StrategyKind::kNone), keyframes).empty());
}

TEST(Strategy, ADistanceIsOfThePathAndNotOfTime) {
  const StrategyOptions options = by_distance(StrategyKind::kDistance, 5);
  EXPECT_EQ(sent_at(options, driven({0, 1, 2, 3, 4, 5, 6}, 2.5)),
            (std::vector<double>{0, 2, 4, 6}));
  // While the vehicle stands still, a distance strategy sends nothing; a periodic one continues.
  const std::vector<Moment> standing{{0, 7}, {10, 7}, {1000, 7}};
  EXPECT_EQ(sent_at(options, standing), (std::vector<double>{0}));
  EXPECT_EQ(sent_at(options_of(StrategyKind::kPeriodic), standing).size(), 3u);
}

TEST(Strategy, LargeCorrectionsShortenTheDistanceAndSmallOnesLengthenIt) {
  const Strategy strategy(by_distance(StrategyKind::kAdaptive, 40));
  StrategyState state = strategy.begin();
  std::vector<double> distances;
  for (const double magnitude_m : {3.0, 3.0, 0.5, 2.0}) {
    state = strategy.answered(state, magnitude_m);
    distances.push_back(state.distance_m);
  }
  const std::vector<double> expected{36, 32.4, 32.724, 33.05124};
  for (std::size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(distances[i], expected[i], 1e-9);
  // The other strategies keep their distance.
  const Strategy fixed(by_distance(StrategyKind::kDistance, 40));
  EXPECT_EQ(fixed.answered(fixed.begin(), 3).distance_m, 40);
}

TEST(Strategy, TheDistanceStaysWithinItsBounds) {
  const Strategy strategy(by_distance(StrategyKind::kAdaptive, 40));
  StrategyState state = strategy.begin();
  for (int i = 0; i < 100; ++i) state = strategy.answered(state, 10);
  EXPECT_EQ(state.distance_m, 1);
  for (int i = 0; i < 1000; ++i) state = strategy.answered(state, 0);
  EXPECT_EQ(state.distance_m, 500);
}

TEST(Strategy, RefusesWhatMakesNoSense) {
  const StrategyOptions adaptive = options_of(StrategyKind::kAdaptive);
  const auto with = [](StrategyOptions options, auto change) {
    change(options);
    return options;
  };
  EXPECT_NO_THROW(Strategy{adaptive});
  for (const StrategyOptions& bad :
       {options_of(StrategyKind::kPeriodic, 0), by_distance(StrategyKind::kDistance, 0),
        with(adaptive, [](auto& o) { o.correction_threshold_m = 0; }),
        with(adaptive, [](auto& o) { o.decrease = 1.1; }),
        with(adaptive, [](auto& o) { o.increase = 0.99; }),
        with(adaptive, [](auto& o) { o.distance_m = 501; })}) {
    EXPECT_THROW(Strategy{bad}, Error);
  }
}

}  // namespace
}  // namespace slambed::cloudslam
