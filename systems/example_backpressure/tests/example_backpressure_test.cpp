// SPDX-License-Identifier: Apache-2.0
// The example's one decision, in virtual time on a synthetic scene.
#include "example_backpressure/example_backpressure.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "edgeslam/edgeslam.hpp"
#include "example_backpressure/backlog_message.hpp"
#include "offload/tests/turning_pair.hpp"

namespace slambed {
namespace {

using testing::conventional;
using testing::PairResult;

constexpr int kFrames = 80;

PairResult run(double backlog_kb, double mbit_per_s, int backlog_keyframes = 1000,
               double edge_stage_us = 2000) {
  auto params = conventional();
  params["backlog_kb"] = backlog_kb;
  params["backlog_keyframes"] = backlog_keyframes;
  DeviceModel edge = testing::uniform_device(edge_stage_us);
  edge.stages["report_backlog"] = {.a_us = 10};
  return testing::run_pair(example_backpressure_system(), params, kFrames, 10,
                           {.mbit_per_s = mbit_per_s, .edge_device = edge}, testing::turn);
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

TEST(ExampleBackpressure, ASlowMapperIsGivenNoMoreThanItHasMapped) {
  constexpr double kSlow_us = 60'000;
  const PairResult waits = run(1e6, 100, 0, kSlow_us);
  const auto withheld = waits.of("keyframe_withheld");
  ASSERT_FALSE(withheld.empty());
  for (const auto& event : withheld) EXPECT_GT(event["backlog_keyframes"].get<int>(), 0);
  EXPECT_LT(waits.keyframes.size(), run(1e6, 100, 1000, kSlow_us).keyframes.size());
}

TEST(ExampleBackpressure, ANewEdgeReportsThatNothingWaits) {
  const PairResult pair = run(1e6, 100);
  const auto reported = std::find_if(pair.mobile.begin(), pair.mobile.end(), [](const auto& event) {
    return event["type"] == "message" && event["channel"] == "backlog";
  });
  ASSERT_NE(reported, pair.mobile.end());
  EXPECT_LT((*reported)["queued_ns"], pair.of("keyframe_created").front()["t_ns"]);
}

TEST(ExampleBackpressure, ItsOwnMessageHasItsNameInTheEvents) {
  const PairResult pair = run(1e6, 100, 0, 60'000);
  int announced = 0;
  for (const auto& event : pair.mobile) {
    if (event["type"] != "message" || event["channel"] != "backlog") continue;
    EXPECT_EQ(event["message"], "BACKLOG");
    EXPECT_EQ(event["direction"], "down");
    ++announced;
  }
  EXPECT_GT(announced, 0);
  EXPECT_EQ(pair.mobile_text.find("UNKNOWN"), std::string::npos);
}

TEST(ExampleBackpressure, ItsOwnMessageIsReadWholeOrNotAtAll) {
  using namespace example_backpressure;
  const Bytes sent = encode(BacklogMessage{.keyframes = 3});
  EXPECT_EQ(decode_backlog(sent).keyframes, 3u);
  EXPECT_THROW(decode_backlog(std::span(sent).first(3)), wire::DecodeError);
  EXPECT_THROW(decode_backlog(Bytes(5)), wire::DecodeError);
}

}  // namespace
}  // namespace slambed
