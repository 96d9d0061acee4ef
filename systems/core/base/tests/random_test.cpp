// SPDX-License-Identifier: Apache-2.0
#include "base/random.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace slambed {
namespace {

TEST(SplitMix64, GivesTheWordsOfItsPublishedImplementation) {
  SplitMix64 random(1234567);
  for (const std::uint64_t word : {6457827717110365317u, 3203168211198807973u, 9817491932198370423u,
                                   4593380528125082431u, 16408922859458223821u}) {
    EXPECT_EQ(random.next(), word);
  }
}

TEST(SplitMix64, UniformNumbersFillTheirInterval) {
  SplitMix64 random(1);
  constexpr int kDraws = 100'000;
  double sum = 0, low = 1, high = 0;
  for (int i = 0; i < kDraws; ++i) {
    const double x = random.uniform();
    ASSERT_TRUE(x >= 0 && x < 1);
    sum += x;
    low = std::min(low, x);
    high = std::max(high, x);
  }
  EXPECT_NEAR(sum / kDraws, 0.5, 3 * std::sqrt(1.0 / 12 / kDraws));
  EXPECT_LT(low, 1e-4);
  EXPECT_GT(high, 1 - 1e-4);
}

TEST(SplitMix64, NormalNumbersHaveTheirMoments) {
  SplitMix64 random(2);
  constexpr int kDraws = 100'000;
  double sum = 0, squares = 0, beyond_two = 0;
  for (int i = 0; i < kDraws; ++i) {
    const double x = random.normal();
    sum += x;
    squares += x * x;
    beyond_two += std::abs(x) > 2;
  }
  EXPECT_NEAR(sum / kDraws, 0, 3 / std::sqrt(kDraws));
  EXPECT_NEAR(squares / kDraws, 1, 3 * std::sqrt(2.0 / kDraws));
  EXPECT_NEAR(beyond_two / kDraws, 0.0455, 3 * std::sqrt(0.0455 / kDraws));
}

}  // namespace
}  // namespace slambed
