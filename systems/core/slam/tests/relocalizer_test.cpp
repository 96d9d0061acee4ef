// SPDX-License-Identifier: Apache-2.0
// Relocalization in a map of a whole room.
#include "slam/relocalizer.hpp"

#include <gtest/gtest.h>

#include "scene_vocabulary.hpp"
#include "slam/tracker.hpp"

namespace slambed::testing {
namespace {

constexpr Seeing kNoisy{
    .pixel_noise = 0.7, .depth_noise = 0.02, .flipped_bits = 10, .wrong_share = 0.1};

/// A camera in the middle of the room that turns right by 3 degrees per frame.
SE3 turned(double frame) {
  const Eigen::Matrix3d R_wc =
      Eigen::AngleAxisd(frame * 3 * M_PI / 180, Eigen::Vector3d::UnitY()).toRotationMatrix();
  return SE3(R_wc, {0.2, 0, -0.1}).inverse();
}
SE3 truth(const SE3& T_cw) { return T_cw * turned(0).inverse(); }

/// A map of the whole room, from a tracker that turned around once.
class RelocalizerTest : public ::testing::Test {
 protected:
  RelocalizerTest()
      : map(std::make_shared<Map>()),
        places(std::make_shared<PlaceIndex>(scene_vocabulary(scene))) {
    Tracker tracker({}, map, IdSpace::kTracker, places);
    for (int i = 0; i < 120; ++i) {
      EXPECT_EQ(tracker.track(i, i / 30.0, scene.look(turned(i))).state, TrackingState::kOk);
      if (i % 5 == 0) tracker.create_keyframe();
    }
  }
  bool locate(const SE3& T_cw, const Seeing& view, Relocalizer& relocalizer) {
    frame.begin(999, 99, scene.look(T_cw, view));
    return relocalizer.locate(*map, {}, search, frame);
  }

  SyntheticScene scene{6000};
  std::shared_ptr<Map> map;
  std::shared_ptr<PlaceIndex> places;
  FrameSearch search;
  Frame frame;
};

TEST_F(RelocalizerTest, FindsEveryDirectionFromOtherPlacesUnderNoise) {
  Relocalizer relocalizer(places);
  int found = 0;
  for (int k = 0; k < 24; ++k) {
    // 0.3 m from the keyframes and between their directions.
    const SE3 T_cw = SE3(Eigen::Matrix3d::Identity(), {0.25, -0.05, 0.2}) * turned(5 * k + 2);
    if (!locate(T_cw, kNoisy, relocalizer)) continue;
    ++found;
    EXPECT_LT(center_error(frame.T_cw, truth(T_cw)), 0.03) << k;
    EXPECT_LT(turn_error_deg(frame.T_cw, truth(T_cw)), 0.5) << k;
    EXPECT_GE(frame.matches(), 50) << k;
  }
  EXPECT_GE(found, 23);
}

TEST_F(RelocalizerTest, AnotherSceneIsNotFound) {
  Relocalizer relocalizer(places);
  SyntheticScene elsewhere(6000, 7);
  for (int k = 0; k < 8; ++k) {
    frame.begin(999, 99, elsewhere.look(turned(15 * k)));
    EXPECT_FALSE(relocalizer.locate(*map, {}, search, frame));
    EXPECT_EQ(frame.matches(), 0);
  }
}

TEST_F(RelocalizerTest, BlackFramesAndEmptyMapsAreRefused) {
  Relocalizer relocalizer(places);
  frame.begin(999, 99, scene.nothing());
  EXPECT_FALSE(relocalizer.locate(*map, {}, search, frame));
  const Map empty;
  frame.begin(999, 99, scene.look(turned(0)));
  EXPECT_FALSE(relocalizer.locate(empty, {}, search, frame));
}

TEST_F(RelocalizerTest, KeepsAnIndexOfItsOwnWhenNoneIsGiven) {
  Relocalizer relocalizer;
  ASSERT_TRUE(locate(turned(31), {}, relocalizer));
  EXPECT_LT(center_error(frame.T_cw, truth(turned(31))), 2e-3);
}

}  // namespace
}  // namespace slambed::testing
