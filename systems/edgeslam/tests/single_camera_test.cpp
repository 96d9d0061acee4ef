// SPDX-License-Identifier: Apache-2.0
// A monocular camera: the mobile's first map has two keyframes, and the edge adopts its scale.
#include <gtest/gtest.h>

#include "edgeslam/tests/edgeslam_runs.hpp"
#include "geometry/alignment.hpp"
#include "wire/messages.hpp"

namespace slambed {
namespace {

namespace runs = testing::edgeslam;
using testing::PairLink;
using testing::PairResult;

constexpr int kWalkFrames = 450;
constexpr double kWalkFps = 30;

PairResult play(nlohmann::json params, int frames, PairLink link = {}) {
  // All points but the first come from the edge; a mobile that waits seconds for them gets lost.
  params["sync_period_s"] = 0.0;
  params["fast_motion_ms"] = 0.0;
  link.single_camera = true;
  return testing::run_pair(edgeslam_system(), params, frames, kWalkFps, link,
                           [](testing::SyntheticScene& scene, int frame) {
                             return scene.look(testing::stroll_round(frame));
                           });
}

Eigen::Vector3d true_center(const NewKeyFrame& keyframe) {
  return testing::stroll_round(static_cast<int>(keyframe.frame_index)).inverse().t;
}

/// Largest distance between a keyframe and the true camera after the best-fitting Sim(3).
double worst_error_m(const MapDelta& map) {
  std::vector<Eigen::Vector3d> mapped, truth;
  for (const NewKeyFrame& keyframe : map.keyframes) {
    mapped.push_back(keyframe.T_cw.inverse().t);
    truth.push_back(true_center(keyframe));
  }
  const auto S = align_sim3(mapped, truth);
  if (!S) return INFINITY;
  double worst = 0;
  for (std::size_t i = 0; i < mapped.size(); ++i)
    worst = std::max(worst, (*S * mapped[i] - truth[i]).norm());
  return worst;
}

int made_by_edge(const MapDelta& map) {
  return static_cast<int>(std::count_if(
      map.points.begin(), map.points.end(),
      [](const NewPoint& point) { return space_of(point.id) == IdSpace::kEdgeMapper; }));
}

class SingleCamera : public ::testing::TestWithParam<std::string> {
 protected:
  static nlohmann::json params() {
    auto params = GetParam() == "static" ? runs::enhanced() : runs::conventional();
    if (GetParam() == "text") params["codec"] = "compatibility";
    return params;
  }
};

TEST_P(SingleCamera, TheEdgeTakesTheMapOfTwoKeyFramesAsItIs) {
  const PairResult result = play(params(), GetParam() == "text" ? kWalkFrames / 3 : kWalkFrames);
  EXPECT_TRUE(result.finished);
  EXPECT_EQ(result.end_reason, "bye");
  ASSERT_EQ(result.of("initialized").size(), 1u);
  EXPECT_TRUE(result.of("track_lost").empty());
  EXPECT_TRUE(result.of("warning").empty());
  // Two keyframes are made at once and sent as one message under the later one's id.
  const auto created = result.of("keyframe_created");
  ASSERT_GT(created.size(), 3u);
  ASSERT_EQ(created[0]["t_ns"], created[1]["t_ns"]);
  const auto received = result.of("keyframe_received");
  ASSERT_FALSE(received.empty());
  EXPECT_EQ(received[0]["keyframe"], created[1]["keyframe"]);
  EXPECT_FALSE(result.of("update_applied").empty());
  // The mobile gets the final poses of both, and the edge made points beyond the first map's.
  for (int k = 0; k < 2; ++k)
    EXPECT_TRUE(result.keyframe_poses.contains({created[k]["keyframe"].get<std::uint64_t>()}));
  EXPECT_GT(made_by_edge(result.edge_map), 100);
  EXPECT_LT(worst_error_m(result.edge_map), 0.02);
}

TEST(SingleCameraStart, TheScaleIsTheFirstMaps) {
  const PairResult result = play(runs::conventional(), kWalkFrames);
  ASSERT_FALSE(result.keyframes.empty());
  const auto sent =
      wire::decode_keyframe(result.keyframes.front(), testing::SyntheticScene(0, 1, true).sensor())
          .delta.keyframes;
  ASSERT_EQ(sent.size(), 2u);
  const double sent_apart = testing::center_error(sent[0].T_cw, sent[1].T_cw);
  const double end_apart = testing::center_error(result.keyframe_poses.at(sent[0].id),
                                                 result.keyframe_poses.at(sent[1].id));
  EXPECT_NEAR(end_apart / sent_apart, 1, 0.02);
}

TEST(SingleCameraLoss, AMapWhoseBeginningWasLostStartsWithOneWholeKeyFrame) {
  PairLink link;
  link.lost = 3;
  const PairResult result = play(runs::conventional(), kWalkFrames, link);
  EXPECT_EQ(result.end_reason, "bye");
  EXPECT_TRUE(result.of("track_lost").empty());
  EXPECT_FALSE(result.of("update_applied").empty());
  EXPECT_GT(made_by_edge(result.edge_map), 100);
  EXPECT_LT(worst_error_m(result.edge_map), 0.02);
}

INSTANTIATE_TEST_SUITE_P(Variants, SingleCamera,
                         ::testing::Values("conventional", "static", "text"),
                         [](const auto& one) { return one.param; });

}  // namespace
}  // namespace slambed
