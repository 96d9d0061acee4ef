// SPDX-License-Identifier: Apache-2.0
#include "wire/handover_messages.hpp"

#include <gtest/gtest.h>

#include "wire/tests/examples.hpp"

namespace slambed::wire {
namespace {

TEST(HandoverMessages, StateComesBackWithAndWithoutAnRtt) {
  StateMessage state{.state = 2, .epoch = 1000, .time = RunTime(-5), .rtt = std::nullopt};
  EXPECT_FALSE(decode_state(encode(state)).rtt);
  state.rtt = std::chrono::milliseconds(37);
  const StateMessage back = decode_state(encode(state));
  EXPECT_EQ(back.state, 2);
  EXPECT_EQ(back.epoch, 1000u);
  EXPECT_EQ(back.time, RunTime(-5));
  EXPECT_EQ(back.rtt, std::chrono::milliseconds(37));
}

TEST(HandoverMessages, ANegativeRttIsRefused) {
  const StateMessage state{.state = 0, .epoch = 0, .time = {}, .rtt = Duration(-1)};
  EXPECT_THROW(decode_state(encode(state)), DecodeError);
}

TEST(HandoverMessages, ATimeThatCannotBeCalculatedWithIsRefused) {
  for (const RunTime time : {RunTime::max(), RunTime::min()}) {
    EXPECT_THROW(decode_state(encode(StateMessage{.time = time, .rtt = {}})), DecodeError);
  }
}

TEST(HandoverMessages, StopStartAndAckComeBack) {
  EXPECT_EQ(decode_stop(encode(StopMessage{7})).epoch, 7u);
  const StartMessage start = decode_start(encode(StartMessage{8, 9}));
  EXPECT_EQ(start.epoch, 8u);
  EXPECT_EQ(start.number, 9u);
  for (const auto answer :
       {HandoverAnswer::kDeclined, HandoverAnswer::kAccepted, HandoverAnswer::kNoMap}) {
    const HandoverAck ack = decode_handover_ack(encode(HandoverAck{10, 11, answer}));
    EXPECT_EQ(ack.epoch, 10u);
    EXPECT_EQ(ack.number, 11u);
    EXPECT_EQ(ack.answer, answer);
  }
  Bytes unknown = encode(HandoverAck{10, 11, HandoverAnswer::kNoMap});
  ++unknown.back();
  EXPECT_THROW(decode_handover_ack(unknown), DecodeError);
}

TEST(HandoverMessages, HandoverComesBackWithItsChanges) {
  std::mt19937 random(3);
  const auto sensor = example_camera().make_sensor();
  const MapHandover handover{
      .epoch = 5, .number = 6, .whole = false, .changes = example_delta(random, sensor)};
  const MapHandover back = decode_handover(encode(handover), sensor);
  EXPECT_EQ(back.epoch, 5u);
  EXPECT_EQ(back.number, 6u);
  EXPECT_FALSE(back.whole);
  ASSERT_EQ(back.changes.keyframes.size(), 1u);
  EXPECT_EQ(back.changes.keyframes[0].points, handover.changes.keyframes[0].points);
  EXPECT_EQ(back.changes.points.size(), handover.changes.points.size());
  EXPECT_EQ(back.changes.culled_points, handover.changes.culled_points);
}

TEST(HandoverMessages, AWholeMapHasAKeyframe) {
  MapHandover handover{.epoch = 1, .number = 1, .whole = false, .changes = {}};
  EXPECT_NO_THROW(decode_handover(encode(handover), nullptr));
  handover.whole = true;
  EXPECT_THROW(decode_handover(encode(handover), nullptr), DecodeError);
}

}  // namespace
}  // namespace slambed::wire
