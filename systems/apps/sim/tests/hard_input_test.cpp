// SPDX-License-Identifier: Apache-2.0
// Sequences of a broken or covered camera. A node without an edge must play them to the end in
// virtual time; sequences that cannot be played are refused before the first frame.
#include <gtest/gtest.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "apps/node/tests/process.hpp"
#include "base/tests/temporary_folder.hpp"
#include "synth/generator.hpp"

namespace slambed {
namespace {

using testing::Process;
using testing::read_text;
namespace fs = std::filesystem;

constexpr int kWidth = 320, kHeight = 240, kFrames = 60;
constexpr std::size_t kPixels = std::size_t{kWidth} * kHeight, kIndexEntry = 16;

/// Returns a generated walk at 15 Hz, which is made once.
const fs::path& walk() {
  static const testing::TemporaryFolder folder;
  static const fs::path path = [] {
    synth::GeneratorOptions options;
    options.width = kWidth;
    options.height = kHeight;
    options.fps = 15;
    options.seconds = kFrames / options.fps;
    synth::generate(options, folder.path() / "walk", 2, [](int, int) { return true; });
    return folder.path() / "walk";
  }();
  return path;
}

/// A copy of the walk that tests corrupt, and the node's results on it.
class HardInput : public ::testing::Test {
 protected:
  HardInput() {
    fs::copy(walk(), folder.path() / "sequence");
    frames = read_text(folder.path() / "sequence" / "frames.bin");
    index = read_text(folder.path() / "sequence" / "index.bin");
    stride = frames.size() / kFrames;
  }

  char* gray(int frame) { return frames.data() + static_cast<std::size_t>(frame) * stride; }
  char* depth(int frame) { return gray(frame) + kPixels; }
  void set_time_ns(int frame, std::int64_t ns) {
    std::memcpy(index.data() + static_cast<std::size_t>(frame) * kIndexEntry, &ns, sizeof ns);
  }

  /// Writes the corrupted sequence with valid checksums, plays it and returns the exit code.
  int play(const std::string& mode) {
    for (int i = 0; i < kFrames; ++i) {
      const auto crc = static_cast<std::uint32_t>(
          ::crc32_z(0, reinterpret_cast<const Bytef*>(gray(i)), 3 * kPixels));
      std::memcpy(index.data() + static_cast<std::size_t>(i) * kIndexEntry + 8, &crc, sizeof crc);
    }
    folder.write("sequence/frames.bin", frames);
    folder.write("sequence/index.bin", index);
    const nlohmann::json cost{{"a_us", 3000}, {"b_us", 0}, {"c_us", 0}, {"jitter", 0}};
    nlohmann::json stages;
    for (const char* stage : {"extract", "track", "relocalize", "create_keyframe", "insert",
                              "cull_points", "triangulate", "fuse", "bundle", "cull_keyframes",
                              "loop_detect", "loop_close", "global_bundle"})
      stages[stage] = cost;
    folder.write(
        "run.json",
        nlohmann::json{
            {"format", "slambed-run"},
            {"version", 1},
            {"run_key", "hard"},
            {"seed", 1},
            {"system", "orbslam2"},
            {"variant", "default"},
            {"params", params(mode)},
            {"sequence", folder.path() / "sequence"},
            {"playback", {{"mode", mode}, {"fps", nullptr}, {"start_s", 0.0}, {"end_s", nullptr}}},
            {"network", nullptr},
            {"output", folder.path()},
            {"connect_timeout_s", 1.0}}
            .dump());
    folder.write("sim.json",
                 nlohmann::json{{"format", "slambed-sim"},
                                {"version", 1},
                                {"run", "run.json"},
                                {"devices",
                                 {{"mobile", {{"cores", 2}, {"speed", 1.0}, {"stages", stages}}},
                                  {"edge", nullptr}}},
                                {"link", nullptr},
                                {"edge_frozen_s", nlohmann::json::array()},
                                {"feature_cache", nullptr}}
                     .dump());
    Process sim({SLAMBED_SIM, "--config", folder.path() / "sim.json"}, folder.path() / "log");
    const int code = sim.wait();
    states.clear();
    std::istringstream lines(read_text(folder.path() / "mobile" / "events.jsonl"));
    for (std::string line; std::getline(lines, line);) {
      const auto event = nlohmann::json::parse(line);
      if (event["type"] == "frame_tracked") states.push_back(event["state"]);
    }
    return code;
  }
  static nlohmann::json params(const std::string& mode) {
    return {{"n_orb", 600},
            {"loop_closing", true},
            {"second_hypotheses", true},
            {"contention", false},
            {"sequential", mode == "every_frame"},
            {"prior_map", ""},
            {"save_map", false}};
  }

  /// Returns the number of frames in [from, to) with a pose.
  long tracked(int from, int to) const {
    return std::count(states.begin() + from, states.begin() + to, "ok");
  }
  void expect_sound_trajectory() const {
    std::istringstream lines(read_text(folder.path() / "mobile" / "trajectory.txt"));
    double last_s = -1;
    int poses = 0;
    for (std::string line; std::getline(lines, line);) {
      if (line[0] == '#') continue;
      std::istringstream numbers(line);
      double value[8] = {};
      for (double& v : value) ASSERT_TRUE(numbers >> v) << line;
      EXPECT_GT(value[0], last_s);
      last_s = value[0];
      for (const double v : value) EXPECT_TRUE(std::isfinite(v)) << line;
      const double length =
          std::hypot(std::hypot(value[4], value[5]), std::hypot(value[6], value[7]));
      EXPECT_NEAR(length, 1, 1e-6) << line;
      ++poses;
    }
    // A young map is discarded when tracking is lost, and the trajectory restarts with the next
    // map.
    const auto reset = std::find(states.rbegin(), states.rend(), "not_initialized");
    EXPECT_EQ(poses,
              tracked(static_cast<int>(states.rend() - reset), static_cast<int>(states.size())));
  }
  /// Plays the sequence in both modes. Expects that the first `good` frames and all from `again` on
  /// are tracked.
  void expect_survived(int good, int again) {
    for (const char* mode : {"every_frame", "realtime"}) {
      SCOPED_TRACE(mode);
      ASSERT_EQ(play(mode), 0) << read_text(folder.path() / "log");
      ASSERT_EQ(states.size(), static_cast<std::size_t>(kFrames));
      EXPECT_EQ(tracked(0, good), good);
      EXPECT_EQ(tracked(again, kFrames), kFrames - again);
      expect_sound_trajectory();
    }
  }

  testing::TemporaryFolder folder;
  std::string frames, index;
  std::size_t stride = 0;
  std::vector<std::string> states;
};

TEST_F(HardInput, TheWalkItselfIsEasy) { expect_survived(kFrames, kFrames); }

TEST_F(HardInput, BlackFrames) {
  for (int i = 30; i < 38; ++i) std::memset(gray(i), 0, 3 * kPixels);
  expect_survived(30, 40);
  EXPECT_EQ(tracked(31, 38), 0);
}

TEST_F(HardInput, FramesOfOneGray) {
  for (int i = 30; i < 38; ++i) std::memset(gray(i), 128, kPixels);
  expect_survived(30, 40);
  EXPECT_EQ(tracked(31, 38), 0);
}

TEST_F(HardInput, NothingButBlack) {
  for (int i = 0; i < kFrames; ++i) std::memset(gray(i), 0, 3 * kPixels);
  for (const char* mode : {"every_frame", "realtime"}) {
    EXPECT_EQ(play(mode), 0);
    EXPECT_EQ(tracked(0, kFrames), 0);
    EXPECT_EQ(std::count(states.begin(), states.end(), "not_initialized"), kFrames);
  }
}

TEST_F(HardInput, ACameraThatHangs) {
  for (int i = 21; i < 40; ++i) std::memcpy(gray(i), gray(20), 3 * kPixels);
  // Frame 40 is a jump of twenty frames.
  expect_survived(40, 46);
}

TEST_F(HardInput, EveryFrameTwice) {
  for (int i = 1; i < kFrames; i += 2) std::memcpy(gray(i), gray(i - 1), 3 * kPixels);
  expect_survived(kFrames, kFrames);
}

TEST_F(HardInput, NoDepthForAWhile) {
  for (int i = 20; i < 40; ++i) std::memset(depth(i), 0, 2 * kPixels);
  expect_survived(kFrames, kFrames);
}

TEST_F(HardInput, NoDepthAtAll) {
  for (int i = 0; i < kFrames; ++i) std::memset(depth(i), 0, 2 * kPixels);
  for (const char* mode : {"every_frame", "realtime"}) {
    EXPECT_EQ(play(mode), 0);
    EXPECT_EQ(tracked(0, kFrames), 0) << "an RGB-D map cannot begin without depth";
  }
}

TEST_F(HardInput, DepthThatSaysNothingTrue) {
  for (int i = 20; i < 30; ++i)
    for (std::size_t p = 0; p < kPixels; ++p) {
      const std::uint16_t value = p % 2 == 0 ? 1 : 65535;
      std::memcpy(depth(i) + 2 * p, &value, sizeof value);
    }
  for (const char* mode : {"every_frame", "realtime"}) {
    EXPECT_EQ(play(mode), 0);
    EXPECT_EQ(states.size(), static_cast<std::size_t>(kFrames));
    EXPECT_EQ(tracked(0, 20), 20);
    expect_sound_trajectory();
  }
}

TEST_F(HardInput, TimeThatJumps) {
  // Three frames within a microsecond, then a gap of an hour.
  constexpr std::int64_t kHour_ns = 3'600'000'000'000;
  for (int i = 30; i < 33; ++i) set_time_ns(i, 2'000'000'000 + (i - 30) * 300);
  for (int i = 33; i < kFrames; ++i) set_time_ns(i, kHour_ns + i * 66'666'667LL);
  ASSERT_EQ(play("every_frame"), 0) << read_text(folder.path() / "log");
  EXPECT_EQ(tracked(0, kFrames), kFrames);
  expect_sound_trajectory();
  ASSERT_EQ(play("realtime"), 0) << read_text(folder.path() / "log");
  EXPECT_GE(states.size(), static_cast<std::size_t>(kFrames - 3))
      << "only those that come together";
  EXPECT_EQ(tracked(0, static_cast<int>(states.size())), static_cast<long>(states.size()));
  expect_sound_trajectory();
}

TEST_F(HardInput, TimeThatRunsBackwardsIsRefused) {
  set_time_ns(30, 1);
  EXPECT_EQ(play("realtime"), 2);
  const std::string log = read_text(folder.path() / "log");
  EXPECT_NE(log.find("time does not increase at frame 30"), std::string::npos) << log;
}

TEST_F(HardInput, ImagesOfAnotherSizeThanTheCameraAreRefused) {
  const auto header = folder.path() / "sequence" / "sequence.json";
  auto json = nlohmann::json::parse(read_text(header));
  json["width"] = 640;
  json["height"] = 480;
  folder.write("sequence/sequence.json", json.dump());
  EXPECT_EQ(play("realtime"), 2);
  const std::string log = read_text(folder.path() / "log");
  EXPECT_NE(log.find("frame_stride_bytes"), std::string::npos) << log;
  EXPECT_EQ(std::count(log.begin(), log.end(), '\n'), 1) << log;
}

}  // namespace
}  // namespace slambed
