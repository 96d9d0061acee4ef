// SPDX-License-Identifier: Apache-2.0
// The transition tables of the four strategies (Sossalla et al. 2022, Sec. IV and Algorithm 1).
#include "dynnetslam/strategy.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "base/error.hpp"

namespace slambed::dynnetslam {
namespace {

using Rtts = std::vector<std::optional<double>>;

Thresholds limits(bool hysteresis, bool safe_zone, double limit_ms = 40, double band_ms = 10,
                  std::optional<double> safe_limit_ms = {}) {
  return thresholds({.hysteresis = hysteresis,
                     .safe_zone = safe_zone,
                     .limit_ms = limit_ms,
                     .band_ms = band_ms,
                     .safe_limit_ms = safe_limit_ms});
}

/// States after each RTT, the first one giving the initial state.
std::string walk(const Thresholds& t, const Rtts& rtts) {
  OffloadingState state = initial_state(rtts.front(), t);
  std::string states(to_string(state));
  for (std::size_t i = 1; i < rtts.size(); ++i) {
    state = next_state(state, rtts[i], t);
    states.append(" ").append(to_string(state));
  }
  return states;
}

TEST(Strategy, HysteresisAndSafeZoneFollowsAlgorithm1) {
  EXPECT_EQ(walk(limits(true, true), {20, 36, 39, 41, 37, 36, 34, 31, 29}),
            "OS SZ SZ MES MES MES SZ SZ OS");
}

TEST(Strategy, HysteresisWithoutSafeZone) {
  EXPECT_EQ(walk(limits(true, false), {20, 41, 44, 46, 41, 36, 34}), "OS OS OS MES MES MES OS");
}

TEST(Strategy, SafeZoneWithoutHysteresis) {
  EXPECT_EQ(walk(limits(false, true), {20, 36, 41, 39, 34}), "OS SZ MES SZ OS");
}

TEST(Strategy, NeitherHysteresisNorSafeZone) {
  EXPECT_EQ(walk(limits(false, false), {20, 39, 41, 39}), "OS OS MES OS");
}

TEST(Strategy, EqualityKeepsTheState) {
  EXPECT_EQ(walk(limits(false, false), {20, 40, 41, 40}), "OS OS MES MES");
  EXPECT_EQ(walk(limits(false, true), {20, 35, 36, 40, 41, 40, 39, 35}),
            "OS OS SZ SZ MES MES SZ SZ");
  EXPECT_EQ(walk(limits(true, false), {20, 45, 46, 35, 34}), "OS OS MES MES OS");
  EXPECT_EQ(walk(limits(true, true), {20, 35, 36, 40, 41, 35, 34, 30, 29}),
            "OS OS SZ SZ MES MES SZ SZ OS");
}

TEST(Strategy, AJumpAcrossTheSafeZoneTakesTwoEvaluations) {
  for (const bool hysteresis : {false, true}) {
    EXPECT_EQ(walk(limits(hysteresis, true), {10, 90, 90, 5, 5}), "OS SZ MES SZ OS");
  }
}

TEST(Strategy, InitialStateDependsOnWhereTheFirstRttLies) {
  EXPECT_EQ(walk(limits(true, true), {29}), "OS");
  EXPECT_EQ(walk(limits(true, true), {30}), "SZ");
  EXPECT_EQ(walk(limits(true, true), {40}), "SZ");
  EXPECT_EQ(walk(limits(true, true), {41}), "MES");
  EXPECT_EQ(walk(limits(true, false), {40}), "OS");
  EXPECT_EQ(walk(limits(true, false), {46}), "MES");
  EXPECT_EQ(walk(limits(false, false), {40}), "OS");
  EXPECT_EQ(walk(limits(false, true), {std::nullopt}), "MES");
}

TEST(Strategy, AMissingRttLeadsToTheMobileSideAndBackOnlyWithOne) {
  EXPECT_EQ(walk(limits(true, true), {20, std::nullopt, std::nullopt, std::nullopt, 20, 20}),
            "OS SZ MES MES SZ OS");
  EXPECT_EQ(walk(limits(false, false), {20, std::nullopt, 20}), "OS MES OS");
}

TEST(Strategy, OtherLimitsMoveAllThresholds) {
  const Thresholds t = limits(true, true, 50, 10);
  EXPECT_DOUBLE_EQ(t.leave_offloading_above, 45);
  EXPECT_DOUBLE_EQ(t.leave_safe_zone_above, 50);
  EXPECT_DOUBLE_EQ(t.leave_mobile_below, 45);
  EXPECT_DOUBLE_EQ(t.leave_safe_zone_below, 40);
}

TEST(Strategy, RefusesLimitsOutOfOrder) {
  EXPECT_THROW(limits(true, true, 40, -1), Error);
  EXPECT_THROW(limits(true, true, 4, 10), Error);
  EXPECT_THROW(limits(true, true, std::numeric_limits<double>::quiet_NaN()), Error);
  EXPECT_THROW(limits(true, true, 40, 10, 50), Error);
}

}  // namespace
}  // namespace slambed::dynnetslam
