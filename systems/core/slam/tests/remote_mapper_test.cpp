// SPDX-License-Identifier: Apache-2.0
// Keyframes of a drifted second trip, matched with the map of the first.
#include "slam/remote_mapper.hpp"

#include <gtest/gtest.h>

#include <map>

#include "map/appearance.hpp"
#include "scene_vocabulary.hpp"

namespace slambed::testing {
namespace {

constexpr int kPerLap = 60;
constexpr std::uint64_t kPrior = std::uint64_t{2} << 56, kTrip = std::uint64_t{1} << 56;
const Seeing kSeeing{.pixel_noise = 0.3, .depth_noise = 0.005, .flipped_bits = 6};

/// On a circle of 0.8 m, looking outwards.
SE3 path(double k) {
  const double a = 2 * M_PI * k / kPerLap;
  const Eigen::Matrix3d R = Eigen::AngleAxisd(a, Eigen::Vector3d::UnitY()).toRotationMatrix();
  return SE3(R, {0.8 * std::sin(a), 0.05 * std::sin(2 * a), 0.8 * std::cos(a)}).inverse();
}

class RemoteMapperTest : public ::testing::Test {
 protected:
  RemoteMapperTest() {
    std::map<int, MapPointId> known;
    std::uint64_t points = 0;
    for (int k = 0; k < kPerLap; ++k)
      map->commit(look(scene, k, path(k), {kPrior | static_cast<unsigned>(k + 1)}, [&](int thing) {
        auto [place, fresh] = known.try_emplace(thing);
        if (fresh) place->second = {kPrior | ++points};
        return place->second;
      }));
    places->update_from(*map);
  }

  /// A keyframe from path(k) with the believed pose T_cw, and all points that it sees.
  template <typename Name>
  static MapDelta look(SyntheticScene& scene, double k, const SE3& T_cw, KeyFrameId id, Name name) {
    MapDelta delta;
    NewKeyFrame keyframe;
    keyframe.id = id;
    keyframe.timestamp_s = k;
    keyframe.features = scene.look(path(k), kSeeing);
    keyframe.T_cw = T_cw;
    for (int i = 0; i < keyframe.features->size(); ++i) {
      const KeyPoint& seen = keyframe.features->keypoint(i);
      NewPoint point;
      point.id = name(scene.seen()[i]);
      point.p_w = T_cw.inverse() *
                  keyframe.features->sensor().camera.unproject(seen.u, seen.v, seen.depth_m);
      point.appearance = appearance_of(point.p_w, T_cw, *keyframe.features, i);
      point.reference = point.first_keyframe = id;
      keyframe.points.push_back(point.id);
      delta.points.push_back(point);
    }
    delta.keyframes.push_back(std::move(keyframe));
    return delta;
  }

  /// A keyframe of the second trip; the point of a thing keeps its id.
  MapDelta receive(double k, const SE3& T_cw) {
    return look(scene, k, T_cw, {kTrip | ++received_}, [&](int thing) {
      auto [place, fresh] = trip_.try_emplace(thing);
      if (fresh) place->second = {kTrip | ++trip_points_};
      return place->second;
    });
  }
  /// Does all work of the edge; returns the pose found, nothing without a match.
  std::optional<SE3> answer(const MapDelta& received, bool estimated = true) {
    match = mapper.match(received, estimated);
    if (!match.matched) return std::nullopt;
    map->commit(match.delta);
    const KeyFrameId id = received.keyframes.front().id;
    if (mapper.begin_bundle(id)) {
      while (mapper.step_bundle()) {
      }
      map->commit(mapper.finish_bundle());
    }
    return map->read([&](const MapView& view) { return view.pose_of(id); });
  }
  std::map<KeyFrameId, SE3> prior_poses() const {
    return map->read([](const MapView& view) {
      std::map<KeyFrameId, SE3> poses;
      for (const KeyFrameId id : view.keyframe_ids())
        if (id.value >= kPrior) poses[id] = view.keyframe(id)->T_cw;
      return poses;
    });
  }

  SyntheticScene scene{9000};
  std::shared_ptr<Map> map = std::make_shared<Map>();
  std::shared_ptr<PlaceIndex> places = std::make_shared<PlaceIndex>(scene_vocabulary(scene));
  static RemoteMapperOptions options() {
    RemoteMapperOptions room;
    room.search_radius_m = 1.5;
    return room;
  }
  RemoteMapper mapper{options(), map, places};
  RemoteMapper::Match match;

 private:
  std::map<int, MapPointId> trip_;
  std::uint64_t received_ = 0, trip_points_ = 0;
};

TEST_F(RemoteMapperTest, PutsDriftedKeyframesWhereTheEarlierTripSays) {
  const auto before = prior_poses();
  Eigen::Matrix<double, 6, 1> drift;
  drift << 0.3, -0.1, 0.2, 0.02, 0.05, -0.02;
  int matched = 0;
  for (int k = 0; k < kPerLap; k += 4) {
    // The pose lies between two poses of the first trip, with growing drift.
    const SE3 truth = path(k + 0.5);
    const SE3 believed = truth * SE3::exp(drift * (0.5 + k / 60.0));
    const auto found = answer(receive(k + 0.5, believed));
    if (!found) continue;
    ++matched;
    EXPECT_LT(center_error(*found, truth), 0.01) << k;
    EXPECT_LT(turn_error_deg(*found, truth), 0.15) << k;
    EXPECT_GE(match.matches, 40);
  }
  EXPECT_EQ(matched, kPerLap / 4);
  const auto after = prior_poses();
  ASSERT_EQ(after.size(), before.size());
  for (const auto& [id, pose] : before) {
    EXPECT_TRUE(after.at(id).R == pose.R && after.at(id).t == pose.t);
  }
}

TEST_F(RemoteMapperTest, NeedsNoEstimateAndNoKeyframesBeforeThisOne) {
  const auto found = answer(receive(17.4, SE3()), false);
  ASSERT_TRUE(found);
  EXPECT_LT(center_error(*found, path(17.4)), 0.01);
}

TEST_F(RemoteMapperTest, AKeyframeStaysAndSharesThePointsOfTheEarlierTrip) {
  ASSERT_TRUE(answer(receive(10.5, path(10.5))));
  const auto first = map->read([](const MapView& view) { return view.point_count(); });
  const MapDelta again = receive(10.7, path(10.7));
  ASSERT_TRUE(answer(again));
  map->read([&](const MapView& view) {
    const KeyFrame* kept = view.keyframe(again.keyframes.front().id);
    EXPECT_TRUE(kept);
    if (!kept) return 0;
    const auto prior = std::count_if(kept->points.begin(), kept->points.end(), [](MapPointId id) {
      return made_by(id, IdSpace::kEdgeMapper);
    });
    EXPECT_GT(prior, 200);
    EXPECT_TRUE(std::any_of(kept->covisibles.begin(), kept->covisibles.end(),
                            [](const auto& c) { return made_by(c.id, IdSpace::kEdgeMapper); }));
    // Nearly all points are those of the first keyframe, not duplicates.
    EXPECT_LT(view.point_count(), first + again.points.size() / 10);
    return 0;
  });
}

TEST_F(RemoteMapperTest, AnotherPlaceIsNotAccepted) {
  SyntheticScene elsewhere(9000, 2);
  const std::size_t keyframes = prior_poses().size();
  for (int k = 0; k < kPerLap; k += 6) {
    std::uint64_t points = 0;
    const MapDelta received = look(elsewhere, k, path(k), {kTrip | static_cast<unsigned>(k + 1)},
                                   [&](int) { return MapPointId{kTrip | ++points}; });
    EXPECT_FALSE(answer(received)) << k;
    EXPECT_GT(match.tried, 0) << "those around the estimate were looked at";
    EXPECT_TRUE(match.delta.empty());
  }
  EXPECT_EQ(map->read([](const MapView& view) { return view.keyframe_count(); }), keyframes);
}

}  // namespace
}  // namespace slambed::testing
