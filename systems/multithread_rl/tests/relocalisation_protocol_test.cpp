// SPDX-License-Identifier: Apache-2.0
// A lost frame's request to the edge: what becomes of each kind of answer, and who ends the loss.
#include <gtest/gtest.h>

#include <optional>
#include <random>

#include "multithread_rl/tests/lost_turn.hpp"
#include "wire/reloc_messages.hpp"

namespace slambed::testing {
namespace {

/// What becomes of an answer, and who ends the loss.
struct Case {
  const char* name;
  bool local;  ///< the mobile's own map shows the place
  PairLink link;
  const char* by;    ///< nullptr: stays lost
  const char* told;  ///< in some event
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

PairLink with(AlteringNetwork::Alter alter) {
  PairLink link;
  link.alter_frames = std::move(alter);
  return link;
}

bool fail(Message& message) {
  message.type = wire::type_of(wire::RelocFail::kType);
  wire::RelocFail failed;
  failed.number = 1;
  message.payload = encode(failed);
  return true;
}

bool never(Message&) { return false; }

bool from_a_former_process(Message& message) {
  ++message.incarnation;
  return true;
}

bool garbage(Message& message) {
  std::mt19937 random(3);
  message.payload.resize(75'000);
  for (auto& byte : message.payload) byte = static_cast<std::uint8_t>(random());
  return true;
}

/// Each answer comes when the next request has been answered.
PairLink late() {
  return with([held = std::make_shared<std::optional<Message>>()](Message& message) {
    std::optional<Message> before = std::exchange(*held, message);
    if (before) message = std::move(*before);
    return before.has_value();
  });
}

class Protocol : public ::testing::TestWithParam<Case> {};

TEST_P(Protocol, EndsALossByTheFirstSuccess) {
  const Case& c = GetParam();
  const PairResult result = lost_turn(lost_turn_params("staged"), c.link,
                                      c.local ? WorldSource::Look(same_place) : far_back);
  ASSERT_EQ(result.of("track_lost").size(), 1u);
  const auto relocalised = result.of("relocalised");
  if (c.by == nullptr) {
    EXPECT_TRUE(relocalised.empty());
  } else {
    ASSERT_EQ(relocalised.size(), 1u);
    EXPECT_EQ(relocalised[0]["by"], c.by);
  }
  EXPECT_TRUE(result.finished);
  EXPECT_EQ(result.end_reason, "bye");
  bool told = false;
  for (const auto& event : result.mobile) {
    for (const char* field : {"reason", "message", "text"}) {
      if (!event.contains(field) || !event[field].is_string()) continue;
      told |= event[field].get<std::string>().find(c.told) != std::string::npos;
    }
  }
  EXPECT_TRUE(told) << c.told;
  // Never two requests under way.
  double asked = 0;
  for (const auto& event : result.mobile) {
    const std::string type = event["type"];
    if (type == "reloc_reply" || type == "reloc_given_up") asked = 0;
    if (type != "reloc_request") continue;
    EXPECT_EQ(asked, 0) << event;
    asked = event["t_ns"];
  }
}

INSTANTIATE_TEST_SUITE_P(
    Table, Protocol,
    ::testing::Values(
        Case{"LocalOk", true, {}, "local", "not lost any more"},
        Case{"LocalFail", true, with(fail), "local", "not asked for"},
        Case{"LocalLate", true, late(), "local", "no answer"},
        Case{"LocalNever", true, with(never), "local", "no answer"},
        Case{"LocalFormer", true, with(from_a_former_process), "local", "its edge is gone"},
        Case{"LocalGarbage", true, with(garbage), "local", "refused"},
        Case{"EdgeOk", false, {}, "edge", "not found"},
        Case{"EdgeFail", false, with(fail), nullptr, "not asked for"},
        Case{"EdgeLate", false, late(), nullptr, "not asked for"},
        Case{"EdgeNever", false, with(never), nullptr, "no answer"},
        Case{"EdgeFormer", false, with(from_a_former_process), nullptr, "its edge is gone"},
        Case{"EdgeGarbage", false, with(garbage), nullptr, "refused"}),
    [](const auto& c) { return c.param.name; });

}  // namespace
}  // namespace slambed::testing
