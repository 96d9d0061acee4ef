// SPDX-License-Identifier: Apache-2.0
// After each kind of segmenter failure, the next image has masks again.
#include "run/segmenter_client.hpp"

#include <gtest/gtest.h>
#include <zlib.h>

#include "base/tests/temporary_folder.hpp"
#include "run/tests/segmenter_server.hpp"
#include "wire/mask_codec.hpp"
#include "wire/tests/examples.hpp"

namespace slambed {
namespace {

using wire::Bytes;
using namespace std::chrono_literals;

constexpr int kAcross = 40, kDown = 30;
constexpr auto kShortLimit = 500ms;
const Bytes kPicture{9, 8, 7};

/// Returns a frame's block as slambed.segment writes it.
Bytes block_of(const FrameMasks& masks) {
  const Bytes body = wire::encode_segmentation(masks);
  wire::ByteWriter out;
  out.u32(static_cast<std::uint32_t>(masks.instances.size()));
  out.u32(static_cast<std::uint32_t>(::crc32_z(0, body.data(), body.size())));
  for (const std::uint8_t byte : body) out.u8(byte);
  return out.take();
}

Bytes answer_of(const FrameMasks& masks) {
  return testing::SegmenterServer::holding(block_of(masks));
}

class SegmenterClientTest : public ::testing::Test {
 protected:
  SegmenterClientTest() {
    sensor->camera.width = kAcross;
    sensor->camera.height = kDown;
    new_client();
  }

  void new_client() {
    client.emplace(SegmenterOptions{.socket = socket, .time_limit = limit},
                   [this] { return sensor; });
  }
  Segmentation ask() { return client->masks(3, kPicture, 0.7); }
  /// Returns the failure text for one bad answer. Later answers are good, over a new connection.
  std::string after(Bytes bad, int calls = 2) {
    std::filesystem::remove(socket);
    new_client();
    bool first = true;
    testing::SegmenterServer server(
        socket, [&](const Bytes&) { return std::exchange(first, false) ? bad : answer_of(masks); });
    const Segmentation failed = ask();
    EXPECT_FALSE(failed.masks);
    const Segmentation next = ask();
    EXPECT_TRUE(next.masks) << next.failure;
    EXPECT_EQ(server.calls(), calls);
    return failed.failure;
  }

  /// Long: an answer that comes must not be missed on a busy machine.
  std::chrono::milliseconds limit = 10s;
  testing::TemporaryFolder folder;
  std::filesystem::path socket = folder.path() / "socket";
  std::shared_ptr<Sensor> sensor = std::make_shared<Sensor>();
  FrameMasks masks = wire::example_masks(kAcross, kDown);
  std::optional<SegmenterClient> client;
};

TEST_F(SegmenterClientTest, AsksOneCallForEachPicturesMasks) {
  std::vector<Bytes> questions;
  testing::SegmenterServer server(socket, [&](const Bytes& question) {
    questions.push_back(question);
    return answer_of(questions.size() == 1 ? masks : FrameMasks{kAcross, kDown, {}});
  });
  const Segmentation first = ask(), second = ask();
  ASSERT_TRUE(first.masks && second.masks) << first.failure << second.failure;
  EXPECT_EQ(wire::encode_masks(*first.masks), wire::encode_masks(masks));
  EXPECT_TRUE(second.masks->instances.empty());
  EXPECT_EQ(server.calls(), 1);
  wire::ByteWriter asked;
  asked.f32(0.7f);
  for (const std::uint8_t byte : kPicture) asked.u8(byte);
  const Bytes expected = asked.take();
  EXPECT_EQ(questions, (std::vector<Bytes>{expected, expected}));
}

TEST_F(SegmenterClientTest, SaysThatNobodyIsThere) {
  EXPECT_NE(ask().failure.find("no segmenter answers"), std::string::npos);
  testing::SegmenterServer server(socket, [&](const Bytes&) { return answer_of(masks); });
  EXPECT_TRUE(ask().masks) << "it came meanwhile";
  sensor.reset();
  EXPECT_NE(ask().failure.find("camera is unknown"), std::string::npos);
}

TEST_F(SegmenterClientTest, SaysThatItWasKilled) {
  EXPECT_NE(after({}).find("the segmenter was lost"), std::string::npos);
}

TEST_F(SegmenterClientTest, SaysThatAPictureWasRefused) {
  EXPECT_NE(after({0, 0, 0, 0}).find("refused the picture"), std::string::npos);
}

TEST_F(SegmenterClientTest, WaitsNoLongerThanItsLimit) {
  limit = kShortLimit;
  const auto began = std::chrono::steady_clock::now();
  // An answer whose length field is one too large: the last byte never arrives.
  Bytes torn = answer_of(masks);
  torn[0] = static_cast<std::uint8_t>(torn[0] + 1);
  EXPECT_NE(after(torn).find("longer than 500 ms"), std::string::npos);
  EXPECT_GE(std::chrono::steady_clock::now() - began, kShortLimit);
}

TEST_F(SegmenterClientTest, SaysWhatNonsenseWasAnswered) {
  EXPECT_NE(after({255, 255, 255, 255}).find("4294967295 bytes"), std::string::npos);
  Bytes damaged = answer_of(masks);
  damaged.back() ^= 1;
  EXPECT_NE(after(damaged).find("checksum"), std::string::npos);
  EXPECT_NE(after({2, 0, 0, 0, 1, 2}).find("checksum"), std::string::npos) << "too short for any";
  Bytes more = block_of(masks);
  more[0] = 3;
  EXPECT_NE(after(testing::SegmenterServer::holding(more)).find("nonsense"), std::string::npos);
}

TEST_F(SegmenterClientTest, TakesNoMasksOfAnotherSize) {
  EXPECT_NE(after(answer_of(wire::example_masks(kAcross, kDown + 1))).find("another size"),
            std::string::npos);
}

TEST_F(SegmenterClientTest, FindsASocketHoweverDeepItLies) {
  const auto deep = folder.path() / std::string(120, 'd');
  std::filesystem::create_directory(deep);
  testing::SegmenterServer server(deep / "socket", [&](const Bytes&) { return answer_of(masks); });
  SegmenterClient far({.socket = deep / "socket"}, [this] { return sensor; });
  const Segmentation found = far.masks(0, kPicture, 0.8);
  EXPECT_TRUE(found.masks) << found.failure;
}

}  // namespace
}  // namespace slambed
