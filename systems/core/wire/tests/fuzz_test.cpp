// SPDX-License-Identifier: Apache-2.0
// Bytes from a hostile or broken peer: a decoder returns a message or throws DecodeError. Run under
// AddressSanitizer and UBSan these tests also show that nothing is read out of bounds.
#include <gtest/gtest.h>

#include <functional>

#include "wire/delta_codec.hpp"
#include "wire/handover_messages.hpp"
#include "wire/message_type.hpp"
#include "wire/tests/examples.hpp"

namespace slambed::wire {
namespace {

struct Target {
  const char* name;
  Bytes valid;
  std::function<void(std::span<const std::uint8_t>)> decode;
};

std::vector<Target> targets() {
  std::mt19937 random(11);
  const auto sensor = example_camera().make_sensor();
  const MapDelta delta = example_delta(random, sensor);
  KeyFrameMessage keyframe{.keyframe = keyframe_id(40), .captured = {}, .delta = delta};
  MapUpdate update{
      .update = 1, .newest = keyframe_id(40), .times = {}, .map = delta, .poses = delta.poses};
  FrameMessage frame{3, 0.5, example_features(random, 40, sensor)};
  Hello hello{.wire_version = kWireVersion,
              .channel = "map",
              .run_key = "k",
              .system = "s",
              .sensor = example_camera()};
  return {
      {"delta", encode(delta), [=](auto b) { decode_delta(b, sensor); }},
      {"keyframe", encode(keyframe), [=](auto b) { decode_keyframe(b, sensor); }},
      {"update", encode(update), [=](auto b) { decode_update(b, sensor); }},
      {"frame", encode(frame), [=](auto b) { decode_frame(b, sensor); }},
      {"poses", encode_poses(delta.poses), [](auto b) { decode_poses(b); }},
      {"ack", encode(AckMessage{300}), [](auto b) { decode_ack(b); }},
      {"bye", encode(ByeMessage{300, 5, 7}), [](auto b) { decode_bye(b); }},
      {"state", encode(StateMessage{2, 300, RunTime(5), Duration(7)}),
       [](auto b) { decode_state(b); }},
      {"stop", encode(StopMessage{300}), [](auto b) { decode_stop(b); }},
      {"start", encode(StartMessage{300, 4}), [](auto b) { decode_start(b); }},
      {"handover", encode(MapHandover{.epoch = 3, .number = 4, .whole = true, .changes = delta}),
       [=](auto b) { decode_handover(b, sensor); }},
      {"handover_ack", encode(HandoverAck{3, 4, true}), [](auto b) { decode_handover_ack(b); }},
      {"hello", encode(hello), [](auto b) { decode_hello(b); }},
  };
}

/// True when the bytes were refused; any other exception fails the test.
bool refused(const Target& target, std::span<const std::uint8_t> bytes) {
  try {
    target.decode(bytes);
    return false;
  } catch (const DecodeError&) {
    return true;
  }
}

TEST(Decoders, AcceptTheValidMessage) {
  for (const Target& target : targets()) EXPECT_FALSE(refused(target, target.valid)) << target.name;
}

TEST(Decoders, RefuseEveryTruncationAndExtension) {
  for (const Target& target : targets()) {
    for (std::size_t n = 0; n < target.valid.size(); ++n) {
      ASSERT_TRUE(refused(target, std::span(target.valid).first(n))) << target.name << " " << n;
    }
    Bytes longer = target.valid;
    longer.push_back(0);
    EXPECT_TRUE(refused(target, longer)) << target.name;
  }
}

TEST(Decoders, SurviveEveryFlippedBit) {
  for (const Target& target : targets()) {
    Bytes bytes = target.valid;
    for (std::size_t bit = 0; bit < bytes.size() * 8; ++bit) {
      bytes[bit / 8] ^= static_cast<std::uint8_t>(1u << (bit % 8));
      ASSERT_NO_THROW(refused(target, bytes)) << target.name << " bit " << bit;
      bytes[bit / 8] = target.valid[bit / 8];
    }
  }
}

TEST(Decoders, SurviveRandomDamage) {
  std::mt19937 random(3);
  for (const Target& target : targets()) {
    for (int i = 0; i < 3000; ++i) {
      Bytes bytes = target.valid;
      for (std::uint32_t n = 1 + random() % 8; n > 0; --n) {
        bytes[random() % bytes.size()] = static_cast<std::uint8_t>(random());
      }
      ASSERT_NO_THROW(refused(target, bytes)) << target.name << " " << i;
    }
  }
}

TEST(Decoders, SurviveRandomBytes) {
  std::mt19937 random(4);
  for (const Target& target : targets()) {
    for (int i = 0; i < 3000; ++i) {
      Bytes bytes(random() % 300);
      for (auto& byte : bytes)
        byte = static_cast<std::uint8_t>(random() % 4 ? random() % 8 : random());
      ASSERT_NO_THROW(refused(target, bytes)) << target.name << " " << i;
    }
  }
}

}  // namespace
}  // namespace slambed::wire
