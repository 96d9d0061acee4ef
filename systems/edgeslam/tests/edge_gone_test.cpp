// SPDX-License-Identifier: Apache-2.0
// An edge that is replaced by another, or never connects again.
#include <gtest/gtest.h>

#include <algorithm>

#include "edgeslam/tests/edgeslam_runs.hpp"
#include "wire/messages.hpp"

namespace slambed {
namespace {

namespace runs = testing::edgeslam;
using testing::PairLink;
using testing::PairResult;
using testing::SyntheticScene;

TEST(EdgeSlam, AnEdgeInThePlaceOfAnotherIsToldNothingOfItsUpdates) {
  using namespace std::chrono_literals;
  auto params = runs::enhanced();
  params["fast_motion_ms"] = 0.0;
  PairLink link;
  link.edge_restarts = 7s;
  const PairResult result = runs::run_over(link, params, 85);
  ASSERT_FALSE(result.of("update_applied").empty());
  const auto restarted = result.of("edge_restarted");
  ASSERT_EQ(restarted.size(), 1u);
  const std::uint64_t begins = restarted[0]["keyframe"];
  std::uint64_t before = 0;
  int after = 0;
  for (const Bytes& sent : result.keyframes) {
    const auto keyframe = wire::decode_keyframe(sent, SyntheticScene().sensor());
    if (keyframe.keyframe.value < begins) {
      before = std::max(before, keyframe.applied_update);
    } else {
      ++after;
      EXPECT_EQ(keyframe.applied_update, 0u);
      EXPECT_EQ(keyframe.first, keyframe.keyframe.value == begins);
    }
  }
  EXPECT_GT(before, 0u);
  EXPECT_GT(after, 1);
  // The new edge asked for a keyframe just then; the one that its map starts with is the answer.
  std::vector<int> urgent;
  for (const auto& made : result.of("keyframe_created")) {
    if (made["t_ns"] >= 7'000'000'000 && made["need"] == "urgent") urgent.push_back(made["frame"]);
  }
  ASSERT_FALSE(urgent.empty());
  EXPECT_EQ(urgent[0], 70);
  EXPECT_FALSE(urgent.size() > 1 && urgent[1] == 71);
}

/// Counts keyframes whose pose on the mobile is bit-identical to the edge's.
int placed_by_the_edge(const PairResult& result, int first_frame, int last_frame) {
  int same = 0;
  for (const NewKeyFrame& keyframe : result.edge_map.keyframes) {
    const auto frame = static_cast<int>(keyframe.frame_index);
    if (frame < first_frame || frame > last_frame) continue;
    const auto known = result.keyframe_poses.find(keyframe.id);
    same += known != result.keyframe_poses.end() && known->second.R == keyframe.T_cw.R &&
            known->second.t == keyframe.T_cw.t;
  }
  return same;
}

/// A link that breaks, so that the edge does not receive the BYE in time.
PairLink that_breaks() {
  PairLink link;
  link.gaps = {{12'000'000'000, 45'000'000'000}};
  return link;
}

TEST(EdgeSlam, PosesOfUpdatesThatWereDeclinedCountWhenTheEdgeIsGone) {
  auto params = runs::enhanced();
  params["sync_period_s"] = 1.0;
  params["min_local_keyframes"] = 100;
  const PairResult result = runs::run_over(that_breaks(), params);
  ASSERT_EQ(result.of("warning").size(), 1u) << "the shutdown was answered";
  ASSERT_TRUE(result.of("update_applied").empty());
  ASSERT_GT(result.of("update_declined").size(), 5u);
  EXPECT_GT(placed_by_the_edge(result, 30, 90), 0);
}

TEST(EdgeSlam, PosesOfUpdatesThatNeverCameAreToldAgain) {
  auto params = runs::enhanced();
  params["sync_period_s"] = 1.0;
  params["fast_motion_ms"] = 0.0;
  PairLink link = that_breaks();
  link.lost_updates = 8;
  const PairResult result = runs::run_over(link, params);
  ASSERT_EQ(result.of("warning").size(), 1u) << "the shutdown was answered";
  ASSERT_GT(result.of("update_applied").size(), 0u);
  EXPECT_GT(placed_by_the_edge(result, 20, 60), 0);
}

}  // namespace
}  // namespace slambed
