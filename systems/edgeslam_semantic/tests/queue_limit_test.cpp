// SPDX-License-Identifier: Apache-2.0
// The mobile's send queues are bounded during an outage, and dropped messages are logged.
#include <gtest/gtest.h>

#include "edgeslam_semantic/tests/semantic_run.hpp"

namespace slambed {
namespace {

constexpr int kWaiting = 3;
constexpr double kGapBegins_s = 1.0, kGapEnds_s = 3.0;

class QueueLimit : public SemanticRun {
 protected:
  QueueLimit() {
    // The gap delays messages instead of dropping them, so only a full queue drops any.
    for (const char* way : {"up", "down"}) {
      scenario["link"][way]["gaps_s"] = {{kGapBegins_s, kGapEnds_s}};
      scenario["link"][way]["gap_drops"] = 0;
    }
  }
  /// Returns uplink messages that were dropped, or those that arrived.
  static std::vector<nlohmann::json> messages(const Played& run, bool dropped) {
    std::vector<nlohmann::json> found;
    for (const auto& message : run.of("message")) {
      const bool counts = message["channel"] == "frame" && message["direction"] == "up" &&
                          message["message"] != "ACK" && message.value("dropped", false) == dropped;
      if (counts) found.push_back(message);
    }
    return found;
  }
  static std::size_t after_gap(const std::vector<nlohmann::json>& events) {
    std::size_t count = 0;
    for (const auto& event : events) count += event["t_ns"].get<double>() > 1e9 * kGapEnds_s;
    return count;
  }
};

TEST_F(QueueLimit, TheOldestUploadsGoAndTheRunGoesOn) {
  nlohmann::json chosen = params();
  chosen["full_offload"] = false;
  chosen["adapt"] = true;
  // Without this limit a young map uploads every frame.
  chosen["keyframes_under_way"] = 0;
  chosen["fixed_row"] = 5;
  chosen["upload_queue"] = 1000;
  EXPECT_TRUE(messages(play(chosen), true).empty());
  chosen["upload_queue"] = kWaiting;
  const Played run = play(chosen);
  const auto dropped = messages(run, true), came = messages(run, false);
  ASSERT_GT(dropped.size(), 3u);
  EXPECT_EQ(dropped.size() + came.size(), run.of("keyframe_sent").size());
  // The oldest is dropped first, so sequence numbers of dropped messages rise.
  std::uint64_t before = 0;
  for (const auto& message : dropped) {
    EXPECT_GT(message["sequence"].get<std::uint64_t>(), before);
    before = message["sequence"];
    EXPECT_LT(message["t_ns"].get<double>(), 1e9 * (kGapEnds_s + 0.5));
  }
  EXPECT_EQ(came.back()["sequence"].get<std::uint64_t>(), run.of("keyframe_sent").size());
  EXPECT_EQ(run.of("frame_answered").size(), std::size_t{kFrames}) << "tracking never waits";
  EXPECT_TRUE(run.of("track_lost").empty());
  // The edge keeps mapping although it lacks some keyframes.
  EXPECT_TRUE(run.of("keyframe_declined").empty());
  EXPECT_GT(after_gap(run.of("slice_applied")), 2u);
}

TEST_F(QueueLimit, TheOldestPicturesGoWhereEveryFrameIsSent) {
  nlohmann::json chosen = params();
  chosen["offload_window"] = 0;
  EXPECT_TRUE(messages(play(chosen), true).empty());
  chosen["picture_queue"] = kWaiting;
  const Played run = play(chosen);
  const auto dropped = messages(run, true);
  ASSERT_GT(dropped.size(), 3u);
  EXPECT_EQ(run.of("frame_answered").size() + dropped.size(), std::size_t{kFrames});
  EXPECT_GT(after_gap(run.of("frame_answered")), 10u);
}

}  // namespace
}  // namespace slambed
