// SPDX-License-Identifier: Apache-2.0
#include "runtime/frame_header.hpp"

#include <gtest/gtest.h>

#include <random>

namespace slambed {
namespace {

FrameHeader example() {
  FrameHeader header;
  header.type = 7;
  header.flags = FrameHeader::kGreetingFlag;
  header.sequence = 0x0123456789abcdef;
  header.queued = RunTime(-5);
  header.sent = RunTime(1234567890123);
  header.length = 40'000;
  header.payload_crc = 0xdeadbeef;
  return header;
}

TEST(FrameHeader, RoundTrip) {
  const auto decoded = FrameHeader::decode(example().encode());
  ASSERT_TRUE(std::holds_alternative<FrameHeader>(decoded));
  const auto& header = std::get<FrameHeader>(decoded);
  EXPECT_EQ(header.type, 7);
  EXPECT_TRUE(header.greeting());
  EXPECT_EQ(header.sequence, 0x0123456789abcdefu);
  EXPECT_EQ(header.queued, RunTime(-5));
  EXPECT_EQ(header.sent, RunTime(1234567890123));
  EXPECT_EQ(header.length, 40'000u);
  EXPECT_EQ(header.payload_crc, 0xdeadbeefu);
}

TEST(FrameHeader, EveryFlippedBitIsNoticed) {
  const auto bytes = example().encode();
  for (std::size_t bit = 0; bit < bytes.size() * 8; ++bit) {
    auto flipped = bytes;
    flipped[bit / 8] ^= static_cast<std::uint8_t>(1u << (bit % 8));
    EXPECT_TRUE(std::holds_alternative<std::string>(FrameHeader::decode(flipped))) << bit;
  }
}

TEST(FrameHeader, ATimeThatCannotBeCalculatedWithIsRefused) {
  for (const RunTime time : {RunTime::max(), RunTime::min()}) {
    FrameHeader queued = example(), sent = example();
    queued.queued = sent.sent = time;
    EXPECT_TRUE(std::holds_alternative<std::string>(FrameHeader::decode(queued.encode())));
    EXPECT_TRUE(std::holds_alternative<std::string>(FrameHeader::decode(sent.encode())));
  }
}

TEST(FrameHeader, RandomBytesAreNoHeader) {
  std::mt19937 random(1);
  for (int i = 0; i < 1000; ++i) {
    std::array<std::uint8_t, FrameHeader::kSize> bytes{};
    for (auto& byte : bytes) byte = static_cast<std::uint8_t>(random());
    EXPECT_TRUE(std::holds_alternative<std::string>(FrameHeader::decode(bytes)));
  }
}

}  // namespace
}  // namespace slambed
