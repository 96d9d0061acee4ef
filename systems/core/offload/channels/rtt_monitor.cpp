// SPDX-License-Identifier: Apache-2.0
#include "offload/channels/rtt_monitor.hpp"

namespace slambed {
namespace {

constexpr Duration kEvery = std::chrono::milliseconds(100);

}  // namespace

void spawn_rtt_monitor(Runtime& runtime, EventLog& log, const Channel& channel) {
  runtime.spawn("rtt", [&log, &channel](Worker& worker) {
    RunTime next{};
    while (!worker.stopping()) {
      worker.sleep_until(next);
      if (const auto rtt = channel.path().smoothed_rtt) {
        log.write(JsonLine("rtt_sample")
                      .add("source", "tcp_info")
                      .add("channel", channel.options().name)
                      .add_ms("rtt_ms", *rtt));
      }
      next = worker.now() + kEvery;
    }
  });
}

}  // namespace slambed
