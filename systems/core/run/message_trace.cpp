// SPDX-License-Identifier: Apache-2.0
#include "run/message_trace.hpp"

#include <ostream>
#include <vector>

#include "base/json_reader.hpp"
#include "run/sim_config.hpp"
#include "runtime/virtual/virtual_network.hpp"

namespace slambed {
namespace {

constexpr std::int64_t kLargestMessage = 64 << 20;
constexpr double kLongestTrace_s = 1e6;

struct TracedMessage {
  RunTime sent;
  std::size_t bytes;
};

struct Silent final : Observer {
  void stage(const StageRecord&) override {}
  void message(const MessageRecord&) override {}
  void link(const ConnectionEvent&) override {}
  void refused(std::uint8_t, std::string_view) override {}
};

std::vector<TracedMessage> read_messages(const nlohmann::json& list, JsonReader& in) {
  if (!list.is_array() || list.empty()) in.fail("messages", "must be a list of messages");
  std::vector<TracedMessage> messages;
  for (const auto& entry : list) {
    JsonReader item(entry, in.where() + "messages[" + std::to_string(messages.size()) + "].");
    const double sent_s = item.number("sent_s");
    const RunTime before = messages.empty() ? RunTime::zero() : messages.back().sent;
    if (sent_s < to_seconds(before) || sent_s > kLongestTrace_s)
      item.fail("sent_s", "must not go back");
    messages.push_back({from_seconds(sent_s),
                        static_cast<std::size_t>(item.integer("bytes", 0, kLargestMessage))});
    item.done();
  }
  return messages;
}

}  // namespace

void play_message_trace(const std::filesystem::path& trace, std::ostream& arrivals) {
  const nlohmann::json json = read_json(trace);
  JsonReader in(json, trace.string() + ": ");
  if (in.text("format") != "slambed-messages") in.fail("format", "must be \"slambed-messages\"");
  in.integer("version", 1, 1);
  const auto seed = static_cast<std::uint64_t>(in.integer("seed", 0, INT64_MAX));
  const LinkModel model = read_link(in.any("link"), in.where() + "link");
  const auto messages = read_messages(in.any("messages"), in);
  in.done();

  Simulator simulator;
  Silent observer;
  VirtualLink link(simulator, model.up, model.down, seed);
  VirtualRuntime mobile(simulator, {}, seed, observer), edge(simulator, {}, seed, observer);
  const ChannelOptions options{.name = "trace"};
  Channel& near = link.mobile_side(observer).open(options);
  Channel& far = link.edge_side(observer).open(options);
  mobile.spawn("sender", [&](Worker& worker) {
    for (const TracedMessage& message : messages) {
      worker.sleep_until(message.sent);
      near.send(0, Bytes(message.bytes));
    }
  });
  edge.spawn("receiver", [&](Worker& worker) {
    for (std::size_t taken = 0; taken < messages.size(); ++taken) {
      const auto message = far.receive(worker, kNever);
      if (!message) break;
      const nlohmann::json line{{"sequence", message->sequence},
                                {"received_ns", message->received.count()}};
      arrivals << line.dump() << '\n';
    }
  });
  simulator.run();
  mobile.join();
  edge.join();
}

}  // namespace slambed
