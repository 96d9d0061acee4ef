// SPDX-License-Identifier: Apache-2.0
// A lost frame's request to the edge: what happens to each kind of answer, and what ends the loss.
#include <gtest/gtest.h>

#include <optional>
#include <random>

#include "multithread_rl/tests/lost_turn.hpp"
#include "wire/reloc_messages.hpp"

namespace slambed::testing {
namespace {

/// Which answers are logged with a reason.
enum class Reported { kOnce, kOfAFoundPose, kOfEveryAnswer };

/// One kind of answer, what happens to it, and what ends the loss.
struct Case {
  const char* name;
  bool local;  ///< the mobile's own map shows the place
  PairLink link;
  const char* by;  ///< nullptr: stays lost
  const char* reason;
  Reported reported = Reported::kOnce;
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

PairLink with(AlteringNetwork::Alter alter) {
  PairLink link;
  link.alter_frames = std::move(alter);
  return link;
}

bool is_found(const Message& message) {
  return message.type == wire::type_of(wire::RelocOk::kType);
}

void fail_as(Message& message, std::uint64_t add) {
  static const SyntheticScene kWorld;
  wire::RelocFail failed;
  failed.number =
      (is_found(message) ? wire::decode_reloc_ok(message.payload, kWorld.sensor()).number
                         : wire::decode_reloc_fail(message.payload).number) +
      add;
  message.type = wire::type_of(wire::RelocFail::kType);
  message.payload = encode(failed);
}

bool fail(Message& message) {
  fail_as(message, 0);
  return true;
}

bool fail_of_another_request(Message& message) {
  fail_as(message, 1000);
  return true;
}

bool never(Message&) { return false; }

bool from_a_former_process(Message& message) {
  ++message.session;
  return true;
}

bool garbage(Message& message) {
  std::mt19937 random(3);
  message.payload.resize(75'000);
  for (auto& byte : message.payload) byte = static_cast<std::uint8_t>(random());
  return true;
}

/// Holds each found pose back until the next; that is requested once the first was given up.
PairLink late() {
  return with([held = std::make_shared<std::optional<Message>>()](Message& message) {
    if (!is_found(message)) return true;
    std::optional<Message> before = std::exchange(*held, message);
    if (before) message = std::move(*before);
    return before.has_value();
  });
}

/// The request of the first frame after the darkness takes this long to the edge. After a local
/// success no more requests are sent, so no later answer could release one held by late().
PairLink slow_after_the_dark(double ms) {
  constexpr int kStepsPerFrame = 5, kFirst = (kDark + kDarkFor) * kStepsPerFrame;
  PairLink link;
  link.step_s = 0.1 / kStepsPerFrame;
  link.one_way_ms.assign(kFirst - 1, 0.1);
  link.one_way_ms.resize(kFirst + 2, ms);
  link.one_way_ms.resize(kLostTurnFrames * kStepsPerFrame, 0.1);
  return link;
}

PairLink twice() {
  PairLink link;
  link.frames_twice = true;
  return link;
}

class Protocol : public ::testing::TestWithParam<std::tuple<Case, const char*>> {};

TEST_P(Protocol, EndsALossByTheFirstSuccess) {
  const auto& [c, map_update] = GetParam();
  auto params = lost_turn_params(map_update);
  // Without updates the mobile's own map keeps the place even on a slow link.
  if (c.local) params["sync_period_s"] = 60.0;
  const PairResult result =
      lost_turn(params, c.link, c.local ? SceneSource::Look(same_place) : far_back);
  ASSERT_EQ(result.of("track_lost").size(), 1u);
  const auto relocalized = result.of("relocalized");
  if (c.by == nullptr) {
    EXPECT_TRUE(relocalized.empty());
  } else {
    ASSERT_EQ(relocalized.size(), 1u);
    EXPECT_EQ(relocalized[0]["by"], c.by);
  }
  EXPECT_TRUE(result.finished);
  EXPECT_EQ(result.end_reason, "bye");
  bool reported = false;
  for (const auto& event : result.mobile) {
    if (c.reported == Reported::kOfAFoundPose && !event.value("found", false)) continue;
    for (const char* field : {"reason", "message", "text"}) {
      if (!event.contains(field) || !event[field].is_string()) continue;
      reported |= event[field].get<std::string>().find(c.reason) != std::string::npos;
    }
  }
  EXPECT_TRUE(reported) << c.reason;
  if (c.reported == Reported::kOfEveryAnswer) {
    for (const auto& reply : result.of("reloc_reply")) EXPECT_EQ(reply["reason"], c.reason);
  }
  // There are never two outstanding requests.
  double asked = 0;
  for (const auto& event : result.mobile) {
    const std::string type = event["type"];
    if (type == "reloc_reply" || type == "reloc_given_up") asked = 0;
    if (type != "reloc_request") continue;
    EXPECT_EQ(asked, 0) << event;
    asked = event["t_ns"];
  }
}

const Case kCases[] = {
    {"LocalOk", true, {}, "local", "not lost any more", Reported::kOfAFoundPose},
    {"LocalFail", true, with(fail), "local", "not found", Reported::kOfEveryAnswer},
    {"LocalForeign", true, with(fail_of_another_request), "local", "not asked for",
     Reported::kOfEveryAnswer},
    {"LocalLate", true, slow_after_the_dark(800), "local", "not lost any more",
     Reported::kOfAFoundPose},
    {"LocalGivenUp", true, slow_after_the_dark(2500), "local", "not asked for",
     Reported::kOfAFoundPose},
    {"LocalNever", true, with(never), "local", "no answer"},
    {"LocalDouble", true, twice(), "local", "not asked for", Reported::kOfAFoundPose},
    {"LocalFormer", true, with(from_a_former_process), "local", "its edge is gone",
     Reported::kOfEveryAnswer},
    {"LocalGarbage", true, with(garbage), "local", "refused"},
    {"EdgeOk", false, {}, "edge", "not found"},
    {"EdgeFail", false, with(fail), nullptr, "not found", Reported::kOfEveryAnswer},
    {"EdgeForeign", false, with(fail_of_another_request), nullptr, "not asked for",
     Reported::kOfEveryAnswer},
    {"EdgeGivenUp", false, late(), nullptr, "not asked for", Reported::kOfAFoundPose},
    {"EdgeNever", false, with(never), nullptr, "no answer"},
    {"EdgeDouble", false, twice(), "edge", "not asked for", Reported::kOfAFoundPose},
    {"EdgeFormer", false, with(from_a_former_process), nullptr, "its edge is gone",
     Reported::kOfEveryAnswer},
    {"EdgeGarbage", false, with(garbage), nullptr, "refused"}};

INSTANTIATE_TEST_SUITE_P(Table, Protocol,
                         ::testing::Combine(::testing::ValuesIn(kCases),
                                            ::testing::Values("serial", "staged")),
                         [](const auto& c) {
                           return std::string(std::get<0>(c.param).name) + "_" +
                                  std::get<1>(c.param);
                         });

}  // namespace
}  // namespace slambed::testing
