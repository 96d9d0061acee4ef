// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "runtime/virtual/virtual_network.hpp"

namespace slambed::testing {

struct CountingObserver final : Observer {
  void stage(const StageRecord&) override {}
  void message(const MessageRecord& r) override { (r.dropped ? dropped : taken) += 1; }
  void link(const ConnectionEvent& r) override {
    ++links;
    if (r.event == "stalled" || r.event == "flowing") {
      stalls.push_back(std::string(r.event) + " " + std::string(r.detail));
    }
  }
  void refused(std::uint8_t, std::string_view) override {}
  std::vector<std::string> stalls;
  int taken = 0, dropped = 0, links = 0;
};

using link::DirectionOptions;

inline constexpr std::int64_t kMs = 1'000'000;

inline DirectionOptions constant(std::int64_t delay_ms, double rate_mbit = 0, double loss = 0) {
  DirectionOptions options;
  options.delays_ns = {delay_ms * kMs};
  if (rate_mbit > 0) {
    options.rate = link::RateOptions{.bits_per_s = rate_mbit * 1e6, .queue_bytes = 10'000'000};
  }
  if (loss > 0) options.loss = link::LossOptions{.loss_good = loss};
  return options;
}

/// Two nodes without compute cost, connected by one channel.
struct Nodes {
  Nodes(const DirectionOptions& up, const DirectionOptions& down,
        ChannelOptions options = {.name = "map"})
      : link(simulator, up, down, 7),
        mobile(simulator, {}, 1, observer),
        edge(simulator, {}, 2, observer),
        near(link.mobile_side(observer).open(options)),
        far(link.edge_side(observer).open(options)) {}

  Simulator simulator;
  CountingObserver observer;
  VirtualLink link;
  VirtualRuntime mobile, edge;
  Channel& near;
  Channel& far;
};

/// Sends messages of the given size at the given times. Returns when each was received.
inline std::vector<Duration> deliver(Nodes& nodes, std::size_t bytes,
                                     const std::vector<RunTime>& times) {
  std::vector<Duration> received;
  nodes.mobile.spawn("sender", [&](Worker& w) {
    for (const RunTime t : times) {
      w.sleep_until(t);
      nodes.near.send(1, Bytes(bytes));
    }
  });
  nodes.edge.spawn("receiver", [&](Worker& w) {
    while (received.size() < times.size()) {
      auto message = nodes.far.receive(w, w.now() + std::chrono::seconds(100));
      if (!message) break;
      EXPECT_EQ(message->sequence, received.size() + 1);
      EXPECT_EQ(message->payload.size(), bytes);
      received.push_back(message->received);
    }
  });
  nodes.simulator.run();
  return received;
}

}  // namespace slambed::testing
