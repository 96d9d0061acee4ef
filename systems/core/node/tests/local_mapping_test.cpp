// SPDX-License-Identifier: Apache-2.0
// The mapping worker and its callers, in virtual time and live. No keyframe is mapped here; the
// stages are tested with the mapper.
#include "node/local_mapping.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <vector>

#include "base/tests/temporary_folder.hpp"
#include "runtime/live/live_runtime.hpp"
#include "runtime/virtual/virtual_runtime.hpp"

namespace slambed::testing {
namespace {

using namespace std::chrono_literals;

constexpr KeyFrameId kKeyFrame{std::uint64_t{1} << 56 | 1};

/// A log whose content is not checked.
class Log {
 public:
  Log() : log_(folder_.path() / "events.jsonl", NodeRole::kMobile) {
    log_.set_clock([] { return RunTime::zero(); });
    log_.start(Duration::zero(), [] {});
  }
  EventLog& get() { return log_; }

 private:
  TemporaryFolder folder_;
  EventLog log_;
};

DeviceModel device() {
  DeviceModel model;
  model.stages["insert"] = {.a_us = 1000};
  return model;
}

TEST(LocalMapping, DrainEndsWhenMappingIsParkedBeforeItTakesTheKeyframe) {
  Log log;
  Simulator simulator;
  VirtualRuntime runtime(simulator, device(), 1, log.get());
  const auto map = std::make_shared<Map>();
  LocalMapping mapping(runtime, log.get(), {}, map, IdSpace::kMobileMapper,
                       LocalMapping::Mode::kWorker);
  mapping.start();
  RunTime drained = kNever;
  // Submits and parks at one instant, before mapping has had its turn.
  runtime.spawn("submitter", [&](Worker& worker) {
    worker.sleep_until(1s);
    mapping.submit(worker, kKeyFrame);
    mapping.drained().wait(worker);
    drained = worker.now();
    runtime.stop();
  });
  runtime.spawn("parker", [&](Worker& worker) {
    worker.sleep_until(1s);
    mapping.park(true);
    worker.sleep_until(worker.now() + 10s);
    runtime.stop();
  });
  simulator.run();
  runtime.join();
  EXPECT_EQ(drained, 1s);
  EXPECT_EQ(mapping.status().queued, 1);
}

TEST(LocalMapping, WhoAsksMayWaitOrLook) {
  Log log;
  Simulator simulator;
  VirtualRuntime runtime(simulator, device(), 1, log.get());
  const auto map = std::make_shared<Map>();
  std::vector<std::uint64_t> begun;
  LocalMapping mapping(runtime, log.get(), {}, map, IdSpace::kMobileMapper,
                       LocalMapping::Mode::kWorker,
                       {.prepare =
                            [&](Worker& worker, KeyFrameId id) {
                              worker.sleep_until(worker.now() + 1s);
                              begun.push_back(id.value);
                              return false;
                            },
                        .done = {},
                        .idle = {},
                        .changed = {}});
  mapping.start();
  runtime.spawn("asker", [&](Worker& worker) {
    const auto keyframe = [](std::uint64_t n) { return KeyFrameId{kKeyFrame.value + n}; };
    const Completion first = mapping.submit(worker, keyframe(0));
    const Completion second = mapping.submit(worker, keyframe(1));
    EXPECT_FALSE(first.done());
    EXPECT_FALSE(first.wait(worker, worker.now() + 500ms)) << "the deadline";
    EXPECT_TRUE(first.wait(worker));
    EXPECT_EQ(worker.now(), 1s);
    EXPECT_FALSE(second.done());
    // A reset drops the third keyframe, which waits, not the second, which runs.
    const Completion third = mapping.submit(worker, keyframe(2));
    const Completion changed = mapping.reset(std::make_shared<Map>());
    EXPECT_FALSE(changed.done());
    EXPECT_TRUE(changed.wait(worker));
    EXPECT_TRUE(second.done() && third.done());
    EXPECT_EQ(worker.now(), 2s);
    // A parked mapper takes no keyframe, but switches to another map.
    mapping.park(true);
    const Completion fourth = mapping.submit(worker, keyframe(3));
    EXPECT_FALSE(fourth.wait(worker)) << "cannot complete";
    EXPECT_FALSE(mapping.drained().wait(worker)) << "cannot complete";
    EXPECT_TRUE(mapping.reset(map).wait(worker));
    EXPECT_TRUE(fourth.done()) << "dropped";
    mapping.park(false);
    EXPECT_TRUE(mapping.drained().wait(worker));
    EXPECT_EQ(worker.now(), 2s);
    runtime.stop();
  });
  simulator.run();
  runtime.join();
  EXPECT_EQ(begun, (std::vector<std::uint64_t>{kKeyFrame.value, kKeyFrame.value + 1}));
}

TEST(LocalMapping, DrainMissesNoWakeUp) {
  constexpr Duration kLong = 2s;
  Log log;
  LiveRuntime runtime(log.get());
  const auto map = std::make_shared<Map>();
  LocalMapping mapping(runtime, log.get(), {}, map, IdSpace::kMobileMapper,
                       LocalMapping::Mode::kWorker);
  std::atomic<int> drained{0};
  std::atomic<bool> over{false}, finished{false};
  mapping.start();
  runtime.spawn("waker", [&](Worker& worker) {  // like a finished bundle
    while (!worker.stopping() && !over) mapping.wake();
  });
  runtime.spawn("drainer", [&](Worker& worker) {
    const RunTime end = worker.now() + kLong;
    while (worker.now() < end && !worker.stopping()) {
      mapping.drained().wait(worker);
      ++drained;
    }
    finished = !worker.stopping();
    over = true;
    runtime.stop();
  });
  runtime.spawn("watchdog", [&](Worker& worker) {  // stops the run if the drainer hangs
    int before = -1;
    while (before != drained && !worker.stopping()) {
      before = drained;
      worker.sleep_until(worker.now() + 5s);
    }
    runtime.stop();
  });
  runtime.join();
  EXPECT_TRUE(finished) << "drain stood still after " << drained << " times";
}

}  // namespace
}  // namespace slambed::testing
