// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include "offload/tests/turning_pair.hpp"
#include "store/map_file.hpp"

namespace slambed::testing {

/// Map files of a turn: the edge's map, and a copy that claims another camera.
class PriorTrip {
 public:
  explicit PriorTrip(const MapDelta& content) : keyframes(content.keyframes.size()) {
    Map map;
    map.commit(content);
    const auto sensor = SyntheticScene(0).sensor();
    MapInfo info{.sensor = {.camera = sensor->camera, .close_depth_m = sensor->close_depth_m},
                 .sequence = "turn",
                 .time_origin_s = 0};
    save_map(map, info, folder_.path() / "prior.slm");
    info.sensor.camera.fx += 1;
    save_map(map, info, folder_.path() / "other.slm");
  }
  std::string map() const { return (folder_.path() / "prior.slm").string(); }
  std::string of_another_camera() const { return (folder_.path() / "other.slm").string(); }

  std::size_t keyframes;

 private:
  TemporaryFolder folder_;
};

constexpr int kTripStart = 20;  ///< frame of the turn near which the later trip starts

/// Half a frame away from the turn's poses, with noisier features.
inline SE3 later_pose(int frame) { return pose_at(kTripStart + frame + 0.5); }
inline std::shared_ptr<const FeatureSet> later_trip(SyntheticScene& scene, int frame) {
  return scene.look(later_pose(frame), {.pixel_noise = 0.4, .depth_noise = 0.01});
}

/// Expects that the later trip relocalized once in the map of the turn and continued in it.
inline void expect_found_in(const PriorTrip& prior, const PairResult& result) {
  EXPECT_TRUE(result.of("initialized").empty());
  EXPECT_TRUE(result.of("edge_restarted").empty());
  EXPECT_TRUE(result.of("warning").empty());
  ASSERT_EQ(result.of("relocalized").size(), 1u);
  EXPECT_EQ(result.of("relocalized")[0]["by"], "map");
  EXPECT_EQ(result.of("frame_tracked").back()["state"], "ok");

  // In the map's world frame: its first camera is where the turn started.
  const SE3 T_wm = pose_at(0).inverse();
  const auto created = result.of("keyframe_created");
  ASSERT_GT(created.size(), 5u);
  for (const auto& event : created) {
    const KeyFrameId id{event["keyframe"].get<std::uint64_t>()};
    EXPECT_EQ(space_of(id), IdSpace::kTracker);
    EXPECT_GT(id.value & 0xffffffff, prior.keyframes) << "an id that the map has";
    const SE3 expected = later_pose(event["frame"].get<int>()) * T_wm;
    EXPECT_LT(center_error(result.keyframe_poses.at(id), expected), 0.03);
  }
  std::size_t joined = 0;
  for (const NewKeyFrame& keyframe : result.edge_map.keyframes)
    joined += (keyframe.id.value & 0xffffffff) > prior.keyframes;
  EXPECT_GT(joined, 3u);
  EXPECT_GT(result.edge_map.keyframes.size(), joined);
  EXPECT_EQ(Map().commit(result.edge_map).unknown, 0);
}

}  // namespace slambed::testing
