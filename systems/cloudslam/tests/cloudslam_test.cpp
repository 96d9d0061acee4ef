// SPDX-License-Identifier: Apache-2.0
// Vehicle and edge in virtual time: a second trip in the map of a first one.
#include "cloudslam/cloudslam.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "base/error.hpp"
#include "cloudslam/trip_archive.hpp"
#include "features/default_vocabulary.hpp"
#include "offload/maps/update_content.hpp"
#include "offload/tests/turning_pair.hpp"
#include "slam/local_mapper.hpp"
#include "store/archive.hpp"

namespace slambed {
namespace {

using nlohmann::json;
using testing::PairLink;
using testing::PairResult;
using testing::pose_at;
using testing::SyntheticScene;

constexpr double kFps = 10;
constexpr int kTripStart = 20;  ///< frame of the first trip near which the second one begins
constexpr int kFrames = 90;

/// Map files of first trips, each made once.
class FirstTrip {
 public:
  static const FirstTrip& get() {
    static const FirstTrip trip;
    return trip;
  }
  std::string map() const { return (folder_.path() / "prior.slm").string(); }
  std::string of_another_camera() const { return (folder_.path() / "other.slm").string(); }

 private:
  FirstTrip() {
    SyntheticScene scene;
    const auto map = std::make_shared<Map>();
    Tracker tracker({}, map, IdSpace::kTracker);
    LocalMapper mapper({}, map, IdSpace::kMobileMapper);
    for (int i = 0; i < kTripStart + kFrames + 20; ++i) {
      tracker.track(i, i / kFps, scene.look(pose_at(i)));
      if (!tracker.wants_keyframe({})) continue;
      mapper.insert(tracker.create_keyframe().keyframes[0].id);
      map->commit(mapper.cull_points());
      map->commit(mapper.fuse());
    }
    const auto sensor = scene.sensor();
    MapInfo info{.sensor = {.camera = sensor->camera, .close_depth_m = sensor->close_depth_m},
                 .sequence = "first",
                 .time_origin_s = 0};
    save_map(*map, info, folder_.path() / "prior.slm");
    info.sensor.camera.fx += 1;
    save_map(*map, info, folder_.path() / "other.slm");
  }
  testing::TemporaryFolder folder_;
};

json params(const std::string& strategy) {
  return {{"n_orb", 1000},
          {"strategy", strategy},
          {"period_s", 1.0},
          {"distance_m", 0.4},
          {"correction_threshold_m", 0.01},
          {"decrease", 0.9},
          {"increase", 1.01},
          {"distance_min_m", 0.1},
          {"distance_max_m", 500.0},
          {"bundle_keyframes", 10},
          {"window_s", 2.0},
          {"back_propagation", "graded"},
          {"align_rate_hz", 2.0},
          {"align_timeout_s", 3.0},
          {"prior_map", FirstTrip::get().map()},
          {"search_radius_m", 1.0},
          {"place_candidates", 5},
          {"near_candidates", 5},
          {"remote_queue", 8},
          {"keyframe_queue", 8},
          {"keyframe_bytes", 0},
          {"codec", "binary"},
          {"upload", false},
          {"second_hypotheses", false}};
}

/// Half a frame away from the first trip's poses, with noisier features.
SE3 trip_pose(int frame) { return pose_at(kTripStart + frame + 0.5); }
std::shared_ptr<const FeatureSet> trip(SyntheticScene& scene, int frame) {
  return scene.look(trip_pose(frame), {.pixel_noise = 0.4, .depth_noise = 0.01});
}

PairResult run(const json& parameters, PairLink link = {}, int frames = kFrames,
               testing::SceneSource::Look look = trip) {
  DeviceModel device = testing::uniform_device(2000);
  for (const char* stage : {"remote_match", "remote_bundle", "apply_correction"})
    device.stages[stage] = device.stages["track"];
  link.mobile_device = link.edge_device = device;
  return testing::run_pair(cloudslam_system(), parameters, frames, kFps, link, std::move(look));
}

std::size_t messages(const PairResult& result, const std::string& name) {
  const auto all = result.of("message");
  return static_cast<std::size_t>(std::count_if(all.begin(), all.end(), [&](const json& message) {
    return message["message"] == name && message.contains("received_ns");
  }));
}

/// Largest distance of a frame's final pose from the truth in the first trip's world, m.
double worst_error_m(const PairResult& result) {
  double worst = 0;
  std::istringstream lines(result.trajectory);
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line[0] == '#') continue;
    double t = 0;
    Eigen::Vector3d at;
    std::istringstream(line) >> t >> at.x() >> at.y() >> at.z();
    const SE3 truth = trip_pose(static_cast<int>(std::lround(t * kFps))) * pose_at(0).inverse();
    worst = std::max(worst, (at - truth.inverse().t).norm());
  }
  return worst;
}

void expect_parts_to_add_up(const json& answer) {
  double sum = 0;
  for (const char* part : {"t_up_ms", "t_wait_ms", "t_match_ms", "t_bundle_ms", "t_down_ms"}) {
    EXPECT_GE(answer[part].get<double>(), 0) << part;
    sum += answer[part].get<double>();
  }
  EXPECT_NEAR(sum, answer["t_response_ms"].get<double>(), 0.01);
}

TEST(CloudSlam, ATripIsPlacedInTheMapOfTheFirstAndCorrectedOnTheWay) {
  const PairResult result = run(params("distance"));
  EXPECT_TRUE(result.finished);
  EXPECT_EQ(result.end_reason, "bye");
  EXPECT_TRUE(result.of("track_lost").empty());
  EXPECT_TRUE(result.of("warning").empty());
  const auto aligned = result.of("trip_aligned");
  ASSERT_EQ(aligned.size(), 1u);
  EXPECT_LT(aligned[0]["align_s"].get<double>(), 1.0);
  const auto changed = result.of("state_changed");
  ASSERT_EQ(changed.size(), 1u);
  EXPECT_EQ(changed[0]["to"], "TRIP");
  const auto applied = result.of("pose_update_applied");
  ASSERT_GE(applied.size(), 4u) << "the initial pose among them";
  EXPECT_GT(applied[0]["magnitude_m"].get<double>(), 0.3) << "the whole map moved";
  for (const json& answer : applied) {
    EXPECT_GE(answer["matches"].get<int>(), 40);
    expect_parts_to_add_up(answer);
  }
  for (std::size_t i = 1; i < applied.size(); ++i)
    EXPECT_LT(applied[i]["magnitude_m"].get<double>(), 0.1);
  EXPECT_TRUE(result.of("pose_update_declined").empty());
  EXPECT_LT(worst_error_m(result), 0.05);
  // The vehicle's map has nothing of the first trip.
  for (const NewKeyFrame& keyframe : result.mobile_map.keyframes)
    EXPECT_EQ(keyframe.id.value >> 56, 1u);
}

TEST(CloudSlam, EachStrategySendsWhatItSays) {
  const auto sent = [](const PairResult& result) {
    std::vector<json> events;
    for (const json& event : result.of("keyframe_sent"))
      if (event["reason"] == "strategy") events.push_back(event);
    return events;
  };
  const PairResult all = run(params("all"));
  const auto made = all.of("keyframe_created");
  const double aligned_s = all.of("trip_aligned").at(0)["seq_s"];
  std::size_t later = 0;
  for (const json& event : made) later += event["seq_s"].get<double>() >= aligned_s;
  EXPECT_EQ(sent(all).size(), later);
  EXPECT_EQ(messages(all, "POSE_UPDATE"), later) << "every one is answered";

  const PairResult periodic = run(params("periodic"));
  const auto in_time = sent(periodic);
  ASSERT_GE(in_time.size(), 3u);
  EXPECT_LT(in_time.size(), later);
  for (std::size_t i = 1; i < in_time.size(); ++i)
    EXPECT_GE(in_time[i]["seq_s"].get<double>() - in_time[i - 1]["seq_s"].get<double>(), 1.0);

  const PairResult none = run(params("none"));
  EXPECT_EQ(none.of("trip_aligned").size(), 1u);
  EXPECT_TRUE(sent(none).empty());
  EXPECT_EQ(messages(none, "KEYFRAME"), 0u);
}

TEST(CloudSlam, TheAdaptiveDistanceFollowsTheCorrections) {
  json small = params("adaptive"), large = params("adaptive");
  small["correction_threshold_m"] = 1000.0;
  large["correction_threshold_m"] = 1e-9;
  const auto last = [](const PairResult& result) {
    return result.of("distance_threshold").back()["distance_m"].get<double>();
  };
  const PairResult lenient = run(small), strict = run(large);
  EXPECT_EQ(lenient.of("distance_threshold").at(0)["distance_m"], 0.4);
  EXPECT_GT(last(lenient), 0.4);
  EXPECT_LT(last(strict), 0.4);
  EXPECT_GT(strict.of("keyframe_sent").size(), lenient.of("keyframe_sent").size());
  EXPECT_EQ(strict.of("distance_threshold").size(), strict.of("pose_update_applied").size())
      << "one at the start, one per answer, none for the initial pose";
}

TEST(CloudSlam, FillerIsCarriedAndNotCharged) {
  json filled = params("periodic");
  filled["keyframe_bytes"] = 60'000;
  const PairResult result = run(filled, {}, 50);
  ASSERT_GE(result.of("pose_update_applied").size(), 2u);
  for (const json& event : result.of("keyframe_sent")) {
    EXPECT_EQ(event["bytes"], std::max(60'000, event["bytes_own"].get<int>() + 8));
    EXPECT_LT(event["bytes_own"].get<int>(), 1000 * 60) << "at most 60 bytes per feature";
  }
  for (const json& message : result.of("message")) {
    if (message["message"] != "POSE_UPDATE") continue;
    EXPECT_LE(message["bytes"].get<int>(), 110);
  }
}

TEST(CloudSlam, TheCompatibilityCodecSaysTheSame) {
  json text = params("periodic");
  text["codec"] = "compatibility";
  const PairResult result = run(text, {}, 40);
  EXPECT_EQ(result.of("trip_aligned").size(), 1u);
  EXPECT_GE(result.of("pose_update_applied").size(), 2u);
  EXPECT_TRUE(result.of("warning").empty());
}

TEST(CloudSlam, WithoutTheEdgeTheVehicleDrivesOnInItsOwnMap) {
  PairLink link;
  link.gaps = {{.start_ns = 2'000'000'000, .end_ns = 6'000'000'000}};
  const PairResult result = run(params("periodic"), link);
  EXPECT_TRUE(result.finished);
  EXPECT_TRUE(result.of("track_lost").empty());
  EXPECT_EQ(result.of("frame_tracked").size(), static_cast<std::size_t>(kFrames));
  bool after = false;
  for (const json& answer : result.of("pose_update_applied"))
    after |= answer["t_ns"].get<double>() > 6e9;
  EXPECT_TRUE(after) << "the edge answers again";
  EXPECT_LT(worst_error_m(result), 0.05);
}

TEST(CloudSlam, ATripThatIsNowhereIsNeverPlaced) {
  const PairResult result = run(params("all"), {}, 60, [](SyntheticScene&, int frame) {
    static SyntheticScene elsewhere(5000, 7);
    return elsewhere.look(trip_pose(frame));
  });
  EXPECT_TRUE(result.of("trip_aligned").empty());
  ASSERT_EQ(result.of("align_failed").size(), 1u);
  EXPECT_GE(result.of("pose_update_empty").size(), 2u) << "no match is answered too";
  EXPECT_EQ(messages(result, "KEYFRAME"), 0u);
  // At most two a second, and none after the timeout.
  EXPECT_LE(result.of("keyframe_sent").size(), 7u);
}

TEST(CloudSlam, MapsThatAreOfNoUseAreRefused) {
  for (const std::string& map :
       {std::string(), FirstTrip::get().of_another_camera(), std::string("nowhere.slm")}) {
    json bad = params("distance");
    bad["prior_map"] = map;
    try {
      run(bad, {}, 1);
      ADD_FAILURE() << map;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::kBadInput) << map;
    }
  }
}

TEST(CloudSlam, AfterTheTripItsKeyframesJoinTheEarlierOnes) {
  json parameters = params("none");
  parameters["upload"] = true;
  const PairResult result = run(parameters, {}, 70);
  const std::size_t made = result.mobile_map.keyframes.size();
  EXPECT_EQ(result.of("keyframe_uploaded").size(), made);
  EXPECT_EQ(messages(result, "TRIP_UPLOAD"), 2u) << "the end, and that all has come";
  EXPECT_TRUE(result.of("warning").empty());

  Map local;
  local.commit(result.mobile_map);
  std::vector<MapDelta> trip;
  for (const NewKeyFrame& keyframe : result.mobile_map.keyframes)
    trip.push_back(local.read(
        [&](const MapView& view) { return extract_keyframes(view, std::array{keyframe.id}); }));
  const auto all = archive(*load_map(FirstTrip::get().map()).map);
  const std::size_t before = count(*all).keyframes;
  const auto places = std::make_shared<PlaceIndex>(default_vocabulary());
  const JoinedTrip joined = join_trip(*all, places, trip);
  EXPECT_EQ(joined.keyframes, made);
  EXPECT_GE(joined.loops, 1) << "they see what the first trip saw";
  EXPECT_TRUE(joined.adjusted);
  EXPECT_EQ(count(*all).keyframes, before + made);
  all->read([&](const MapView& view) {
    for (const NewKeyFrame& keyframe : result.mobile_map.keyframes) {
      const SE3 truth = trip_pose(static_cast<int>(keyframe.frame_index)) * pose_at(0).inverse();
      EXPECT_LT(testing::center_error(view.keyframe(keyframe.id)->T_cw, truth), 0.05);
    }
    return 0;
  });
  // Keyframes of the archive are not added again; the next trip can use the result.
  EXPECT_EQ(join_trip(*all, places, trip).keyframes, 0u);
  EXPECT_EQ(count(*archive(*all)).keyframes, before + made);
}

TEST(CloudSlam, TheVehiclesBundlesAreAsSmallAsAskedAndTheTripIsAsRight) {
  // Observations in all bundles; n1 is above 0 where one begins.
  const auto observations = [](const PairResult& result) {
    double sum = 0;
    for (const json& stage : result.of("stage"))
      if (stage["name"] == "bundle") sum += stage["n1"].get<double>();
    return sum;
  };
  json parameters = params("none");
  parameters["bundle_keyframes"] = 0;
  const PairResult whole = run(parameters);
  parameters["bundle_keyframes"] = 1;
  const PairResult small = run(parameters);
  EXPECT_GT(observations(small), 0);
  EXPECT_LT(2 * observations(small), observations(whole));
  EXPECT_LT(worst_error_m(whole), 0.1);
  EXPECT_LT(worst_error_m(small), 0.1);
}

TEST(CloudSlam, TheSameSeedGivesTheSameBytes) {
  const PairResult first = run(params("adaptive"), {}, 40),
                   second = run(params("adaptive"), {}, 40);
  EXPECT_EQ(first.mobile_text, second.mobile_text);
  EXPECT_EQ(first.edge_text, second.edge_text);
}

}  // namespace
}  // namespace slambed
