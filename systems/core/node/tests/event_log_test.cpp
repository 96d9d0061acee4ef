// SPDX-License-Identifier: Apache-2.0
#include "node/event_log.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>
#include <thread>

#include "base/error.hpp"
#include "base/tests/temporary_folder.hpp"
#include "wire/messages.hpp"

namespace slambed {
namespace {

using namespace std::chrono_literals;

std::vector<nlohmann::json> lines_of(const std::filesystem::path& path) {
  std::vector<nlohmann::json> lines;
  std::istringstream text(testing::read_text(path));
  for (std::string line; std::getline(text, line);) lines.push_back(nlohmann::json::parse(line));
  return lines;
}

TEST(JsonLine, QuotesWhatJsonCannotHold) {
  EXPECT_EQ(json_quote("a\"b\\c\n\x01"), "\"a\\\"b\\\\c\\u000a\\u0001\"");
  EXPECT_EQ(json_quote("caf\xC3\xA9"), "\"caf\xC3\xA9\"");
  EXPECT_EQ(json_quote("\xFF\xC3"), "\"\xEF\xBF\xBD\xEF\xBF\xBD\"");
  for (const char* bad : {"\xC0\xAF", "\xED\xA0\x80", "\xF4\x90\x80\x80", "\xE2\x82"}) {
    EXPECT_TRUE(nlohmann::json::accept(json_quote(bad))) << bad;
  }
  JsonLine line("x");
  line.add("nan", std::numeric_limits<double>::quiet_NaN()).add("big", UINT64_MAX).add("yes", true);
  EXPECT_EQ(line.fields(), R"("type":"x","nan":null,"big":18446744073709551615,"yes":true)");
}

TEST(EventLog, WritesTheDocumentedFields) {
  testing::TemporaryFolder folder;
  const auto path = folder.path() / "events.jsonl";
  EventLog log(path, NodeRole::kEdge);
  log.set_clock([] { return RunTime(5); });
  log.start(0ns, [] {});
  log.stage({.name = "track",
             .worker = "tracking",
             .wall = 1500us,
             .cpu = 1ms,
             .units = {.n1 = 10, .n2 = 2.5}});
  MessageRecord message{.channel = "keyframe",
                        .incoming = true,
                        .type = 1,
                        .bytes = 40,
                        .sequence = 3,
                        .queued = 1ns,
                        .sent = 2ns,
                        .received = 3ns};
  log.message(message);
  message.incoming = false;
  message.dropped = true;
  message.type = wire::type_of(wire::kMapUpdate);
  log.message(message);
  log.link({.channel = "map", .event = "rejected", .detail = "because"});
  log.warning("careful");
  log.flush();
  const auto lines = lines_of(path);
  ASSERT_EQ(lines.size(), 5u);
  EXPECT_EQ(lines[0], nlohmann::json::parse(R"({"t_ns":5,"type":"stage","name":"track",
      "worker":"tracking","wall_ms":1.5,"cpu_ms":1.0,"n1":10.0,"n2":2.5})"));
  EXPECT_EQ(lines[1], nlohmann::json::parse(R"({"t_ns":5,"type":"message","channel":"keyframe",
      "direction":"up","message":"KEYFRAME","bytes":40,"sequence":3,"queued_ns":1,"sent_ns":2,
      "received_ns":3})"));
  EXPECT_EQ(lines[2]["direction"], "down");
  EXPECT_EQ(lines[2]["dropped"], true);
  EXPECT_FALSE(lines[2].contains("received_ns"));
  EXPECT_EQ(lines[3]["event"], "rejected");
  EXPECT_EQ(lines[4]["text"], "careful");
}

TEST(EventLog, EventsBeforeTheStartAreMovedToRunTime) {
  testing::TemporaryFolder folder;
  const auto path = folder.path() / "events.jsonl";
  EventLog log(path, NodeRole::kMobile);
  RunTime now = 100ns;
  RunTime zero{};
  log.set_clock([&] { return now - zero; });
  log.warning("early");
  log.flush();
  EXPECT_TRUE(lines_of(path).empty());
  now = 200ns;
  log.start(150ns, [&] { zero = 150ns; });
  log.warning("late");
  log.flush();
  const auto lines = lines_of(path);
  ASSERT_EQ(lines.size(), 2u);
  EXPECT_EQ(lines[0]["t_ns"], -50);
  EXPECT_EQ(lines[1]["t_ns"], 50);
}

TEST(EventLog, LinesOfManyThreadsStayWhole) {
  testing::TemporaryFolder folder;
  const auto path = folder.path() / "events.jsonl";
  {
    EventLog log(path, NodeRole::kMobile);
    log.set_clock([] { return 0ns; });
    log.start(0ns, [] {});
    std::vector<std::jthread> threads;
    for (int t = 0; t < 4; ++t) {
      threads.emplace_back([&log, t] {
        for (int i = 0; i < 500; ++i) {
          log.write(JsonLine("x").add("thread", t).add("i", i));
          if (i % 100 == 0) log.flush();
        }
      });
    }
  }
  const auto lines = lines_of(path);
  EXPECT_EQ(lines.size(), 2000u);
  std::array<int, 4> next{};
  for (const auto& line : lines) {
    EXPECT_EQ(line["i"].get<int>(), next[line["thread"].get<std::size_t>()]++);
  }
}

TEST(EventLog, AnUnwritablePlaceIsAnEnvironmentError) {
  try {
    EventLog log("/nonexistent-folder/events.jsonl", NodeRole::kMobile);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kEnvironment);
  }
  EventLog full("/dev/full", NodeRole::kMobile);
  full.set_clock([] { return 0ns; });
  full.start(0ns, [] {});
  full.warning("x");
  EXPECT_THROW(full.flush(), Error);
}

TEST(EventLog, ASuccessorGoesOnBehindAHalfLine) {
  testing::TemporaryFolder folder;
  const auto path = folder.path() / "events.jsonl";
  folder.write("events.jsonl", "{\"t_ns\":1,\"type\":\"warning\"}\n{\"t_ns\":2,\"ty");
  {
    EventLog log(path, NodeRole::kEdge, EventLog::Open::kAppend);
    log.set_clock([] { return RunTime(5); });
    log.start(0ns, [] {});
    log.write(JsonLine("node_restarted"));
  }
  EXPECT_EQ(testing::read_text(path),
            "{\"t_ns\":1,\"type\":\"warning\"}\n{\"t_ns\":2,\"ty\n"
            "{\"t_ns\":5,\"type\":\"node_restarted\"}\n");
}

}  // namespace
}  // namespace slambed
