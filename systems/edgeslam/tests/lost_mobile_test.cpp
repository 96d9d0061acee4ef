// SPDX-License-Identifier: Apache-2.0
// A mobile that lost tracking is relocalized with the edge's help.
#include <gtest/gtest.h>

#include "edgeslam/tests/edgeslam_runs.hpp"

namespace slambed {
namespace {

namespace runs = testing::edgeslam;
using testing::PairLink;
using testing::PairResult;
using testing::SyntheticScene;
using testing::turn;

/// Ten seconds of turning, one second of darkness, then the view from second two again. The local
/// map of one keyframe does not reach back that far; the edge's map does.
std::shared_ptr<const FeatureSet> dark_for_a_second(SyntheticScene& scene, int frame) {
  if (frame >= 100 && frame < 110) return scene.nothing();
  return turn(scene, frame < 100 ? frame : frame - 90);
}

PairResult run_through_darkness(PairLink link, nlohmann::json params = runs::enhanced()) {
  return testing::run_pair(edgeslam_system(), params, 200, 10, link, dark_for_a_second);
}

TEST(EdgeSlam, ALostMobileFindsItselfWithTheEdgesHelp) {
  const PairResult result = run_through_darkness({});
  EXPECT_EQ(result.of("track_lost").size(), 1u);
  const auto relocalized = result.of("relocalized");
  ASSERT_EQ(relocalized.size(), 1u);
  int in_the_edges_map = 0;
  for (const auto& update : result.of("update_applied")) {
    in_the_edges_map += update["relocalization"] == true &&
                        update["t_ns"].get<double>() < relocalized[0]["t_ns"].get<double>();
  }
  EXPECT_GT(in_the_edges_map, 0);
  EXPECT_EQ(result.of("frame_tracked").back()["state"], "ok");

  // The edge is needed: when it never receives the frames, the mobile stays lost.
  PairLink deaf;
  deaf.lossy_channel = "frame";
  deaf.lost = 1000;
  const PairResult alone = run_through_darkness(deaf);
  for (const auto& event : alone.of("relocalized")) {  // until it sees the place where it was lost
    EXPECT_GT(event["t_ns"].get<double>(), relocalized[0]["t_ns"].get<double>() + 4e9);
  }
}

TEST(EdgeSlam, NoRegularUpdateLeavesWhileTheMobileAsksWhereItIs) {
  auto params = runs::enhanced();
  params["n_kf"] = 6;
  params["sync_period_s"] = 0.0;
  params["fast_motion_ms"] = 0.0;
  int mapped = 0;
  // Slow edges: when tracking is lost, keyframes still wait to be mapped.
  for (const double stage_us : {60'000.0, 100'000.0, 150'000.0, 200'000.0}) {
    PairLink link;
    link.edge_device = testing::uniform_device(stage_us);
    const PairResult result = run_through_darkness(link, params);
    double asked = 0;
    for (const auto& event : result.edge) {
      const std::string type = event["type"];
      if (type == "message" && event["message"] == "FRAME") asked = event["t_ns"];
      if (type == "keyframe_received" || type == "keyframe_declined") asked = 0;
      if (asked == 0) continue;
      mapped += type == "keyframe_mapped";
      if (type == "update_sent" && event["t_ns"].get<double>() > asked) {
        EXPECT_EQ(event["relocalization"], true) << event;
      }
    }
    for (const auto& declined : result.of("update_declined")) {
      EXPECT_NE(declined["reason"], "a newer one came");
    }
  }
  EXPECT_GT(mapped, 0) << "nothing was there to be sent";
}

}  // namespace
}  // namespace slambed
