// SPDX-License-Identifier: Apache-2.0
// The core's message numbers and names are fixed, a system may add its own, and none may clash.
#include "wire/message_names.hpp"

#include <gtest/gtest.h>

#include "base/error.hpp"
#include "wire/frame_messages.hpp"
#include "wire/handover_messages.hpp"
#include "wire/messages.hpp"
#include "wire/trip_messages.hpp"

namespace slambed::wire {
namespace {

constexpr MessageRange kOwn(128, {"HELLO", "", "GOODBYE"});

std::string complaint(const MessageRange& range) {
  try {
    MessageNames names(std::array{kOwn, range});
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kInternal);
    return error.what();
  }
  return "";
}

TEST(MessageNames, TheCoresNumbersStayWhatTheyAreOnTheWire) {
  EXPECT_EQ(type_of(kKeyFrame), 1);
  EXPECT_EQ(type_of(AckMessage::kType), 5);
  EXPECT_EQ(type_of(kKeyFrameWanted), 10);
  EXPECT_EQ(type_of(HandoverAck::kType), 20);
  EXPECT_EQ(type_of(kTripUpload), 51);
  EXPECT_EQ(type_of(FrameResult::kType), 65);
  const MessageNames names;
  EXPECT_EQ(names[1], "KEYFRAME");
  EXPECT_EQ(names[20], "HANDOVER_ACK");
  EXPECT_EQ(names[65], "FRAME_RESULT");
  for (const int nobodys : {0, 11, 66, 128, 255}) EXPECT_EQ(names[nobodys], "UNKNOWN") << nobodys;
}

TEST(MessageNames, ASystemsOwnJoinThem) {
  const MessageNames names(std::array{kOwn});
  EXPECT_EQ(type_of(kOwn["GOODBYE"]), 130);
  EXPECT_EQ(names[128], "HELLO");
  EXPECT_EQ(names[129], "UNKNOWN");  // the number of a removed type
  EXPECT_EQ(names[130], "GOODBYE");
  EXPECT_EQ(names[1], "KEYFRAME");
}

TEST(MessageNames, NeitherANumberNorANameIsGivenTwice) {
  EXPECT_EQ(complaint({130, {"MORE"}}), "message MORE, type 130: the number is that of GOODBYE");
  EXPECT_EQ(complaint({200, {"HELLO"}}), "message HELLO, type 200: the name is taken");
  EXPECT_EQ(complaint({255, {"LAST", "MORE"}}), "message MORE, type 256: the last number is 255");
  EXPECT_EQ(complaint({129, {"BETWEEN"}}), "");
}

TEST(MessageNames, NumbersBelow128AreTheCoresEvenWhereNothingHasThem) {
  EXPECT_EQ(complaint({80, {"MORE"}}), "message MORE, type 80: numbers below 128 are the core's");
}

}  // namespace
}  // namespace slambed::wire
