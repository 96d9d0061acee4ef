// SPDX-License-Identifier: Apache-2.0
// Dispatch of messages by type, and refusal of those that cannot be decoded.
#include "node/messaging.hpp"

#include <gtest/gtest.h>

#include "base/tests/temporary_folder.hpp"
#include "node/event_log.hpp"
#include "wire/handover_messages.hpp"
#include "wire/messages.hpp"

namespace slambed::testing {
namespace {

Message message(wire::MessageType type, Bytes payload) {
  Message made;
  made.type = wire::type_of(type);
  made.sequence = 7;
  made.payload = std::move(payload);
  return made;
}

class Messaging : public ::testing::Test {
 protected:
  Messaging() {
    log.set_clock([] { return RunTime::zero(); });
    log.start(Duration::zero(), [] {});
  }
  std::string written() {
    log.flush();
    return read_text(path);
  }
  TemporaryFolder folder;
  std::filesystem::path path = folder.path() / "events.jsonl";
  EventLog log{path, NodeRole::kEdge};
};

TEST_F(Messaging, EachMessageComesToWhoAskedForItsType) {
  Inbox inbox(log);
  std::vector<std::string> heard;
  inbox.on<wire::AckMessage>(wire::decode_ack, [&](const wire::AckMessage& ack,
                                                   const Message& raw) {
    heard.push_back("ack " + std::to_string(ack.sequence) + " in " + std::to_string(raw.sequence));
  });
  inbox.on(wire::MapHandover::kType, [&](Message& raw) {
    const Bytes taken = std::move(raw.payload);
    heard.push_back("map of " + std::to_string(taken.size()));
  });
  EXPECT_TRUE(inbox.dispatch(message(wire::MapHandover::kType, Bytes(5))));
  EXPECT_TRUE(
      inbox.dispatch(message(wire::AckMessage::kType, encode(wire::AckMessage{.sequence = 3}))));
  EXPECT_FALSE(inbox.dispatch(message(wire::ByeMessage::kType, {})));
  EXPECT_EQ(heard, (std::vector<std::string>{"map of 5", "ack 3 in 7"}));
  EXPECT_EQ(log.refused(), 0);
}

TEST_F(Messaging, WhatCannotBeReadIsCountedAndSaidOnce) {
  Inbox inbox(log);
  int heard = 0;
  inbox.on<wire::ByeMessage>(wire::decode_bye,
                             [&](const wire::ByeMessage&, const Message&) { ++heard; });
  EXPECT_TRUE(inbox.dispatch(message(wire::ByeMessage::kType, Bytes(1))));
  EXPECT_FALSE(read(log, message(wire::AckMessage::kType, {}), wire::decode_ack));
  EXPECT_EQ(heard, 0);
  EXPECT_EQ(log.refused(), 2);
  const std::string events = written();
  EXPECT_NE(events.find("BYE refused: message ends too early"), std::string::npos) << events;
  EXPECT_NE(events.find("ACK refused: message ends too early"), std::string::npos) << events;
  EXPECT_EQ(std::count(events.begin(), events.end(), '\n'), 2);
}

}  // namespace
}  // namespace slambed::testing
