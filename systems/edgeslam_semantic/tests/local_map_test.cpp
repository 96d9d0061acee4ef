// SPDX-License-Identifier: Apache-2.0
// How a slice changes the mobile's local map: newer keyframes, own points, and deletions.
#include <gtest/gtest.h>

#include <random>

#include "edgeslam_semantic/labels.hpp"
#include "edgeslam_semantic/local_map.hpp"
#include "edgeslam_semantic/messages.hpp"
#include "edgeslam_semantic/semantic_edge.hpp"
#include "wire/tests/examples.hpp"

namespace slambed::edgeslam_semantic {
namespace {

using wire::keyframe_id;
using wire::point_id;

/// Two keyframes in the window, and one that is newer than the edge's map.
class LocalMap : public ::testing::Test {
 protected:
  static constexpr int kFeatures = 40;

  LocalMap() {
    std::mt19937 random(3);
    const auto sensor = wire::example_camera().make_sensor();
    MapDelta delta;
    for (std::uint64_t k = 1; k <= 3; ++k) {
      NewKeyFrame keyframe;
      keyframe.id = keyframe_id(k);
      keyframe.features = wire::example_features(random, kFeatures, sensor);
      keyframe.T_cw = SE3(Eigen::Matrix3d::Identity(), Eigen::Vector3d(-0.1 * double(k), 0, 0));
      keyframe.points.resize(kFeatures);
      for (int i = 0; i < kFeatures; ++i) keyframe.points[i] = point_id(std::uint64_t(i) + 1);
      own[keyframe.id] = {k, double(k), keyframe.features};
      delta.keyframes.push_back(keyframe);
    }
    for (int i = 0; i < kFeatures; ++i) {
      NewPoint point;
      point.id = point_id(std::uint64_t(i) + 1);
      point.p_w = {0.1 * i, 0.05 * (i % 7), 2 + 0.1 * i};
      point.reference = point.first_keyframe = keyframe_id(1);
      delta.points.push_back(point);
    }
    // One more point of the mobile's own, which only the two newest keyframes see.
    NewPoint mine;
    mine.id = own_point;
    mine.p_w = {1, 1, 4};
    mine.reference = mine.first_keyframe = keyframe_id(2);
    delta.points.push_back(mine);
    delta.keyframes[1].points[5] = delta.keyframes[2].points[5] = own_point;
    before.commit(delta);
    window = before.read([](const MapView& view) {
      return window_of(view, std::vector{keyframe_id(1), keyframe_id(2)});
    });
    window.points.erase(own_point);
    window.keyframes[keyframe_id(2)].points.erase(5);
  }

  MapDelta made(KeyFrameId newest, std::set<MapPointId> gone = {}) {
    return before.read([&](const MapView& view) {
      S = correction_at(view, newest, window);
      return local_map(view, {.window = window,
                              .own = own,
                              .newest = newest,
                              .S_new_old = S,
                              .gone = std::move(gone)});
    });
  }

  const MapPointId own_point = point_id(1, IdSpace::kMobileMapper);
  Map before;
  std::map<KeyFrameId, OwnKeyFrame> own;
  MapWindow window;
  Sim3 S;
};

TEST_F(LocalMap, WhatIsNewerThanTheSliceMovesAlongWithItsScale) {
  // The edge has the same world at twice the scale, rotated and shifted.
  const Sim3 moved{
      2, Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY()).toRotationMatrix(), {1, 2, 3}};
  for (auto& [id, p_w] : window.points) p_w = moved * p_w;
  for (auto& [id, observed] : window.keyframes)
    observed.T_cw = to_se3(to_sim3(observed.T_cw) * moved.inverse());
  Map after;
  after.commit(made(keyframe_id(2)));
  EXPECT_NEAR(S.scale, 2, 1e-6);
  after.read([&](const MapView& view) {
    EXPECT_EQ(view.keyframe_count(), 3u);
    EXPECT_LT((view.point(own_point)->p_w - moved * Eigen::Vector3d(1, 1, 4)).norm(), 1e-6);
    const SE3 was(Eigen::Matrix3d::Identity(), Eigen::Vector3d(-0.3, 0, 0));
    const SE3 wanted = to_se3(to_sim3(was) * moved.inverse());
    EXPECT_LT((view.keyframe(keyframe_id(3))->T_cw.t - wanted.t).norm(), 1e-6);
    EXPECT_LT((view.keyframe(keyframe_id(3))->T_cw.R - wanted.R).norm(), 1e-9);
    return 0;
  });
}

TEST_F(LocalMap, AnOwnPointBecomesTheEdgesWhereBothSawTheSameFeature) {
  const MapPointId edges = point_id(9, IdSpace::kEdgeMapper);
  window.points[edges] = {1.01, 1, 4};
  window.keyframes[keyframe_id(2)].points[5] = edges;
  Map after;
  after.commit(made(keyframe_id(2)));
  after.read([&](const MapView& view) {
    EXPECT_EQ(view.keyframe(keyframe_id(3))->points[5], edges);
    EXPECT_EQ(view.point(own_point), nullptr);
    EXPECT_EQ(view.point(edges)->observations.size(), 2u);
    EXPECT_GT(view.point(edges)->appearance.max_distance_m, 0) << "it can be looked for";
    return 0;
  });
}

TEST_F(LocalMap, WhatTheEdgeDeletedGoesAndWhatIsOlderGoesToo) {
  window.keyframes.erase(keyframe_id(1));
  Map after;
  after.commit(made(keyframe_id(2), {point_id(3)}));
  after.read([&](const MapView& view) {
    EXPECT_EQ(view.keyframe(keyframe_id(1)), nullptr);
    EXPECT_EQ(view.point(point_id(3)), nullptr);
    EXPECT_NE(view.point(point_id(4)), nullptr);
    return 0;
  });
  Map covered;
  covered.commit(made(keyframe_id(3)));
  covered.read([&](const MapView& view) {
    EXPECT_EQ(view.keyframe(keyframe_id(3)), nullptr) << "the slice covers it and has it not";
    EXPECT_EQ(view.point(own_point), nullptr);
    return 0;
  });
}

TEST_F(LocalMap, TheEdgeKnowsAnOwnPointByTheFeatureItSaw) {
  // The edge has made its own point at feature 5 of keyframe 2 before keyframe 4 brings the
  // mobile's.
  Map edge;
  MapDelta known = before.read([&](const MapView& view) {
    MapDelta delta;
    const KeyFrame& two = *view.keyframe(keyframe_id(2));
    delta.keyframes.push_back({.id = two.id,
                               .features = two.features,
                               .T_cw = two.T_cw,
                               .points = std::vector<MapPointId>(kFeatures),
                               .parent = {}});
    delta.keyframes.back().points[5] = point_id(9, IdSpace::kEdgeMapper);
    NewPoint point;
    point.id = point_id(9, IdSpace::kEdgeMapper);
    point.reference = point.first_keyframe = two.id;
    delta.points.push_back(point);
    return delta;
  });
  edge.commit(known);
  MapDelta sent;
  sent.keyframes.push_back(known.keyframes.front());
  sent.keyframes.back().id = keyframe_id(4);
  sent.keyframes.back().points.assign(kFeatures, {});
  sent.keyframes.back().points[8] = own_point;
  sent.keyframes.back().points[9] = point_id(2, IdSpace::kMobileMapper);
  for (const MapPointId id : {own_point, point_id(2, IdSpace::kMobileMapper)}) {
    NewPoint point;
    point.id = id;
    point.reference = point.first_keyframe = keyframe_id(4);
    sent.points.push_back(point);
  }
  sent.attach = {{keyframe_id(2), 5, own_point},
                 {keyframe_id(2), 6, point_id(2, IdSpace::kMobileMapper)}};
  const MapDelta fits = edge.read([&](const MapView& view) { return as_known_here(view, sent); });
  EXPECT_EQ(fits.keyframes.front().points[8], point_id(9, IdSpace::kEdgeMapper));
  EXPECT_EQ(fits.keyframes.front().points[9], point_id(2, IdSpace::kMobileMapper));
  EXPECT_EQ(fits.points.size(), 1u);
  EXPECT_EQ(fits.attach.size(), 1u);
}

TEST_F(LocalMap, AnObservationOfAPointThatTheSliceDeletedGoesWithIt) {
  OptResult deletes;
  deletes.changes.culled_points = {point_id(3)};
  deletes.left_points = {point_id(4)};
  deletes.changes.fusions = {{point_id(5), point_id(6)}};
  apply(window, {deletes.changes, {}, deletes.left_points});
  const auto& seen = window.keyframes.at(keyframe_id(2)).points;
  for (const auto& [feature, point] : seen) EXPECT_TRUE(window.points.contains(point)) << feature;
  Map after;
  after.commit(made(keyframe_id(2)));
  EXPECT_LT(count(after).keyframes, 4u);
}

TEST_F(LocalMap, FeaturesAreKeptOfTheWindowAndOfWhatIsNewer) {
  const OwnKeyFrame one = own.at(keyframe_id(3));
  for (std::uint64_t k = 4; k <= 1000; ++k) {
    own[keyframe_id(k)] = one;
    window.keyframes.erase(keyframe_id(k - 3));
    window.keyframes[keyframe_id(k - 1)];
    forget_left(own, window, keyframe_id(k - 1));
    ASSERT_LE(own.size(), 4u) << k;
  }
  EXPECT_TRUE(own.contains(keyframe_id(999)));
  EXPECT_TRUE(own.contains(keyframe_id(1000))) << "newer than the slice";
  forget_left(own, {}, keyframe_id(1000));
  EXPECT_EQ(own.size(), 3u) << "an empty window tells nothing";
}

/// In front of a wall no keyframe leaves the window, but the edge deletes all except the first.
TEST_F(LocalMap, FeaturesOfKeyFramesThatTheEdgeDeletedAreNotKept) {
  const OwnKeyFrame one = own.at(keyframe_id(3));
  for (std::uint64_t k = 4; k <= 1000; ++k) {
    own[keyframe_id(k)] = one;
    window.keyframes.erase(keyframe_id(k - 2));
    window.keyframes[keyframe_id(1)];
    window.keyframes[keyframe_id(k - 1)];
    forget_left(own, window, keyframe_id(k - 1));
    ASSERT_LE(own.size(), 5u) << k;
  }
  EXPECT_TRUE(own.contains(keyframe_id(1)));
}

TEST_F(LocalMap, PointsMostlySeenOnWhatMovesGoOthersLoseThatObservation) {
  Labels labels;
  labels[keyframe_id(1)].assign(kFeatures, 0);
  labels[keyframe_id(1)][0] = 1;  // one of three observations
  labels[keyframe_id(2)].assign(kFeatures, 0);
  labels[keyframe_id(2)][5] = 1;                // one of two
  labels[keyframe_id(7)].assign(kFeatures, 1);  // not in the map
  const MapDelta delta =
      before.read([&](const MapView& view) { return without_labeled(view, labels); });
  EXPECT_EQ(delta.culled_points, std::vector{own_point});
  ASSERT_EQ(delta.detach.size(), 1u);
  EXPECT_EQ(delta.detach.front().point, point_id(1));
}

}  // namespace
}  // namespace slambed::edgeslam_semantic
