// SPDX-License-Identifier: Apache-2.0
#include "sequence/prepared_sequence.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <nlohmann/json.hpp>

#include "base/error.hpp"
#include "base/tests/temporary_folder.hpp"
#include "runtime/frame_header.hpp"

namespace slambed {
namespace {

constexpr int kTinyWidth = 64, kTinyHeight = 48, kFrames = 3;
constexpr std::size_t kPixels = kTinyWidth * kTinyHeight, kStride = 12288;

nlohmann::json header() {
  return {{"format", "slambed-sequence"},
          {"version", 1},
          {"id", "tiny"},
          {"title", "Tiny"},
          {"sensor", "rgbd"},
          {"width", kTinyWidth},
          {"height", kTinyHeight},
          {"frames", kFrames},
          {"frame_stride_bytes", kStride},
          {"fps", 30.0},
          {"camera",
           {{"fx", 50.0},
            {"fy", 51.0},
            {"cx", 32.0},
            {"cy", 24.0},
            {"bf", 4.0},
            {"distortion", {0.1, 0.2, 0, 0, 0.3}}}},
          {"depth_unit_m", 0.001},
          {"close_depth_baselines", 40.0},
          {"time_origin_s", 1305031102.175304},
          {"source", nlohmann::json::object()},
          {"checksum", "00"}};
}

class PreparedSequenceTest : public ::testing::Test {
 protected:
  void SetUp() override {
    frames.resize(kFrames * kStride);
    for (std::size_t i = 0; i < frames.size(); ++i) frames[i] = static_cast<char>(i * 7 + i / 251);
    write();
  }

  void write() {
    std::string index;
    for (int i = 0; i < kFrames; ++i) {
      const std::int64_t time = times[i];
      const std::uint32_t crc =
          checksum({reinterpret_cast<const std::uint8_t*>(frames.data()) + i * kStride, block});
      const std::uint32_t flags = 0;
      char entry[16];
      std::memcpy(entry, &time, 8);
      std::memcpy(entry + 8, &crc, 4);
      std::memcpy(entry + 12, &flags, 4);
      index.append(entry, sizeof entry);
    }
    folder.write("sequence.json", json.dump());
    folder.write("index.bin", index);
    folder.write("frames.bin", frames);
  }

  std::string complaint() {
    try {
      PreparedSequence sequence(folder.path());
      return "";
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::kBadInput);
      return error.what();
    }
  }

  testing::TemporaryFolder folder;
  nlohmann::json json = header();
  std::string frames;
  std::size_t block = 3 * kPixels;
  std::int64_t times[kFrames] = {0, 33'333'333, 66'666'667};
};

TEST_F(PreparedSequenceTest, ShowsHeaderAndPixels) {
  const PreparedSequence sequence(folder.path());
  EXPECT_EQ(sequence.frames(), 3u);
  EXPECT_EQ(sequence.camera().fy, 51);
  EXPECT_EQ(sequence.camera().distortion[4], 0.3);
  EXPECT_EQ(sequence.time_origin_ns(), 1'305'031'102'175'304'000);
  EXPECT_NEAR(sequence.close_depth_m(), 3.2, 1e-12);
  const auto frame = sequence.frame(2);
  EXPECT_EQ(frame.timestamp_ns, 66'666'667);
  EXPECT_EQ(frame.gray.at(5, 7),
            static_cast<std::uint8_t>(frames[2 * kStride + 7 * kTinyWidth + 5]));
  std::uint16_t depth = 0;
  std::memcpy(&depth,
              frames.data() + 2 * kStride + kTinyWidth * kTinyHeight + 2 * (7 * kTinyWidth + 5), 2);
  EXPECT_EQ(frame.depth.at(5, 7), depth);
  EXPECT_NO_THROW(sequence.verify_all());
}

TEST_F(PreparedSequenceTest, AStereoSequenceHasARightImageAndNoDepth) {
  json["sensor"] = "stereo";
  json["depth_unit_m"] = 0.0;
  block = 2 * kPixels;
  write();
  const PreparedSequence sequence(folder.path());
  EXPECT_EQ(sequence.sensor(), SensorKind::kStereo);
  EXPECT_NO_THROW(sequence.verify_all());
  const auto frame = sequence.frame(1);
  EXPECT_EQ(frame.right.at(5, 7),
            static_cast<std::uint8_t>(frames[kStride + kPixels + 7 * kTinyWidth + 5]));
  EXPECT_EQ(frame.depth.data, nullptr);
}

TEST_F(PreparedSequenceTest, AMonoSequenceHasOneImageAndNoBaseline) {
  json["sensor"] = "mono";
  json["depth_unit_m"] = 0.0;
  block = kPixels;
  write();
  const PreparedSequence sequence(folder.path());
  EXPECT_EQ(sequence.sensor(), SensorKind::kMono);
  EXPECT_NO_THROW(sequence.verify_all());
  EXPECT_EQ(sequence.camera().bf, 0);
  EXPECT_EQ(sequence.close_depth_m(), 0);
  const auto frame = sequence.frame(2);
  EXPECT_EQ(frame.gray.at(5, 7),
            static_cast<std::uint8_t>(frames[2 * kStride + 7 * kTinyWidth + 5]));
  EXPECT_EQ(frame.right.data, nullptr);
  EXPECT_EQ(frame.depth.data, nullptr);
}

TEST_F(PreparedSequenceTest, DamageIsFoundAndNamed) {
  frames[kStride + 100] ^= 1;
  folder.write("frames.bin", frames);
  const PreparedSequence sequence(folder.path());  // frame 0 is intact
  EXPECT_NO_THROW(sequence.verify(0));
  EXPECT_THROW(sequence.verify(1), Error);
  EXPECT_THROW(sequence.verify_all(), Error);
  frames[100] ^= 1;
  folder.write("frames.bin", frames);
  EXPECT_NE(complaint().find("frame 0 is damaged"), std::string::npos);
}

TEST_F(PreparedSequenceTest, WrongSizesAndTimesAreRefused) {
  folder.write("frames.bin", frames.substr(1));
  EXPECT_NE(complaint().find("frames.bin"), std::string::npos);
  write();
  folder.write("index.bin", std::string(15, '\0'));
  EXPECT_NE(complaint().find("index.bin"), std::string::npos);
  times[2] = times[1];
  write();
  EXPECT_NE(complaint().find("time does not increase at frame 2"), std::string::npos);
}

TEST_F(PreparedSequenceTest, WrongHeadersAreNamed) {
  const auto with = [&](const char* pointer, nlohmann::json value) {
    json = header();
    json[nlohmann::json::json_pointer(pointer)] = std::move(value);
    write();
    return complaint();
  };
  EXPECT_NE(with("/format", "x").find("format"), std::string::npos);
  EXPECT_NE(with("/version", 2).find("version"), std::string::npos);
  EXPECT_NE(with("/sensor", "sonar").find("sensor is 'sonar'"), std::string::npos);
  EXPECT_NE(with("/frame_stride_bytes", 4096).find("frame_stride_bytes"), std::string::npos);
  EXPECT_NE(with("/frame_stride_bytes", 12289).find("frame_stride_bytes"), std::string::npos);
  EXPECT_NE(with("/width", 0).find("width"), std::string::npos);
  EXPECT_NE(with("/depth_unit_m", 0).find("depth_unit_m"), std::string::npos);
  EXPECT_NE(with("/camera/fx", -1).find("camera.fx"), std::string::npos);
  EXPECT_NE(with("/camera/distortion", {1, 2}).find("camera.distortion"), std::string::npos);
  EXPECT_NE(with("/frames", 4).find("index.bin"), std::string::npos);
}

TEST(PreparedSequence, AFolderWithoutOneIsBadInput) {
  EXPECT_THROW(PreparedSequence("/nonexistent-folder"), Error);
}

}  // namespace
}  // namespace slambed
