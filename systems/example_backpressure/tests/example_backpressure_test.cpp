// SPDX-License-Identifier: Apache-2.0
// The example's one decision, in virtual time on a synthetic world.
#include "example_backpressure/example_backpressure.hpp"

#include <gtest/gtest.h>

#include "edgeslam/edgeslam.hpp"
#include "offload/tests/turning_pair.hpp"

namespace slambed {
namespace {

using testing::conventional;
using testing::PairResult;

constexpr int kFrames = 80;

PairResult run(double backlog_kb, double mbit_per_s) {
  auto params = conventional();
  params["backlog_kb"] = backlog_kb;
  return testing::run_pair(example_backpressure_system(), params, kFrames, 10,
                           {.mbit_per_s = mbit_per_s}, testing::turn);
}

TEST(ExampleBackpressure, WithoutABacklogItIsEdgeSlamByteForByte) {
  const PairResult ours = run(1e6, 100);
  auto params = conventional();
  params.update(testing::ours());
  const PairResult edge_slam =
      testing::run_pair(edgeslam_system(), params, kFrames, 10, {.mbit_per_s = 100}, testing::turn);
  EXPECT_EQ(ours.trajectory, edge_slam.trajectory);
  EXPECT_EQ(ours.keyframes, edge_slam.keyframes);
  EXPECT_TRUE(ours.of("keyframe_withheld").empty());
}

TEST(ExampleBackpressure, ASlowLinkIsGivenNoMoreThanItHasCarried) {
  constexpr double kLimit_kb = 20;
  const PairResult waits = run(kLimit_kb, 1);
  const auto withheld = waits.of("keyframe_withheld");
  ASSERT_FALSE(withheld.empty());
  for (const auto& event : withheld) {
    EXPECT_GT(event["backlog_bytes"].get<double>(), 1000 * kLimit_kb);
  }
  EXPECT_LT(waits.keyframes.size(), run(1e6, 1).keyframes.size());
  EXPECT_EQ(waits.of("frame_tracked").size(), static_cast<std::size_t>(kFrames));
}

}  // namespace
}  // namespace slambed
