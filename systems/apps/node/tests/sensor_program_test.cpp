// SPDX-License-Identifier: Apache-2.0
// slambed-node with cameras other than RGB-D.
#include <Eigen/Core>

#include "apps/node/tests/node_program.hpp"

namespace slambed {
namespace {

namespace fs = std::filesystem;

constexpr int kFrames = 75;

/// Returns the positions of a TUM file in order.
std::vector<Eigen::Vector3d> places(const fs::path& trajectory) {
  std::istringstream lines(testing::read_text(trajectory));
  std::vector<Eigen::Vector3d> list;
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line);
    double time = 0;
    Eigen::Vector3d p;
    if (words >> time >> p.x() >> p.y() >> p.z()) list.push_back(p);
  }
  return list;
}

double end_to_end_m(const std::vector<Eigen::Vector3d>& list) {
  return list.empty() ? 0 : (list.back() - list.front()).norm();
}

class SensorProgram : public testing::NodeProgramTest {
 protected:
  SensorProgram() : NodeProgramTest(kFrames) {}

  /// Generates a sequence for this kind of camera and makes the run play it.
  fs::path play(const std::string& sensor, int width = 320) {
    const fs::path made = folder.path() / sensor;
    synth::GeneratorOptions options;
    options.sensor = sensor;
    options.seed = 7;
    options.width = width;
    options.height = width * 3 / 4;
    options.fps = 15;
    options.seconds = kFrames / options.fps;
    synth::generate(options, made, 2, [](int, int) { return true; });
    config["sequence"] = made;
    return made;
  }

  void run_alone_and_sequentially(int features = 600) {
    use_orbslam2();
    config["params"]["n_orb"] = features;
    config["playback"]["mode"] = "every_frame";
    config["params"]["sequential"] = true;
    start();
    testing::Process mobile = node("mobile");
    ASSERT_EQ(mobile.wait(), 0) << log("mobile");
    EXPECT_EQ(events("mobile", "initialized").size(), 1u);
    EXPECT_TRUE(events("mobile", "track_lost").empty());
  }
};

TEST_F(SensorProgram, StereoRunsAloneInMeters) {
  const auto truth = places(play("stereo") / "groundtruth.txt");
  run_alone_and_sequentially();
  const auto traveled = places(folder.path() / "mobile" / "trajectory.txt");
  ASSERT_EQ(traveled.size(), static_cast<std::size_t>(kFrames));
  EXPECT_GT(end_to_end_m(truth), 0.3);
  EXPECT_NEAR(end_to_end_m(traveled) / end_to_end_m(truth), 1, 0.03);
}

TEST_F(SensorProgram, StereoRunsWithAnEdge) {
  play("stereo");
  play_for(3);
  testing::Process edge = node("edge"), mobile = node("mobile");
  ASSERT_TRUE(await("edge/ready.json") && await("mobile/ready.json"))
      << log("edge") << log("mobile");
  start();
  EXPECT_EQ(mobile.wait(), 0) << log("mobile");
  EXPECT_EQ(edge.wait(), 0) << log("edge");
  EXPECT_FALSE(events("edge", "keyframe_mapped").empty());
  EXPECT_FALSE(events("mobile", "update_applied").empty());
}

TEST_F(SensorProgram, OneCameraStartsFromTwoFrames) {
  play("mono", 640);
  run_alone_and_sequentially(1000);
  const auto first = events("mobile", "initialized");
  ASSERT_EQ(first.size(), 1u);
  const auto keyframes = events("mobile", "keyframe_created");
  ASSERT_GE(keyframes.size(), 2u);
  EXPECT_LT(keyframes[0]["frame"], keyframes[1]["frame"]);
  EXPECT_EQ(keyframes[1]["frame"], first[0]["frame"]);
  const auto tracked = places(folder.path() / "mobile" / "trajectory.txt").size();
  EXPECT_EQ(tracked, kFrames - first[0]["frame"].get<std::size_t>());
  EXPECT_GT(tracked, static_cast<std::size_t>(kFrames) / 2);
}

TEST_F(SensorProgram, ASystemThatCannotDoWithOneCameraSaysSo) {
  play("mono");
  use("example_backpressure");
  config["params"]["backlog_kb"] = 100.0;
  config["params"]["backlog_keyframes"] = 1;
  testing::Process mobile = node("mobile");
  EXPECT_EQ(mobile.wait(), 2);
  expect_error("mobile", "is mono, example_backpressure plays rgbd");
}

}  // namespace
}  // namespace slambed
