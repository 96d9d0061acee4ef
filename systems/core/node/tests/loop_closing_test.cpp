// SPDX-License-Identifier: Apache-2.0
// Loop closing after mapping: order of work, background bundle and resets in virtual time, and once
// live with threads.
#include "node/loop_closing.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <nlohmann/json.hpp>
#include <sstream>

#include "base/tests/temporary_folder.hpp"
#include "runtime/live/live_runtime.hpp"
#include "runtime/virtual/virtual_runtime.hpp"
#include "slam/tests/drifted_laps.hpp"

namespace slambed::testing {
namespace {

using namespace std::chrono_literals;

DeviceModel loop_device(double bundle_us) {
  DeviceModel model;
  model.cores = 2;
  for (const char* stage : {"loop_detect", "loop_close"}) model.stages[stage] = {.a_us = 1000};
  model.stages["global_bundle"] = {.a_us = bundle_us};
  return model;
}

/// A mapper that does no work itself, followed by loop closing. Keyframes come every 100 ms, the
/// last one some time after the loop.
class LoopClosingTest : public ::testing::Test {
 protected:
  using Mode = LocalMapping::Mode;
  using OnClosed = std::function<void(Worker&, LocalMapping&, LoopClosing&)>;

  void run(Mode mode, int limit, const OnClosed& on_closed = {}) {
    TemporaryFolder folder;
    laps = std::make_unique<DriftedLaps>(DriftedLaps::Drift());
    {
      Simulator simulator;
      EventLog log(folder.path() / "events.jsonl", NodeRole::kMobile);
      log.set_clock([&simulator] { return simulator.now(); });
      log.start(Duration::zero(), [] {});
      VirtualRuntime runtime(simulator, loop_device(bundle_us), 1, log);
      LoopClosing* behind = nullptr;
      LocalMapping mapping(runtime, log, {}, laps->map, IdSpace::kMobileMapper, mode,
                           {.prepare = {},
                            .done = {},
                            .idle =
                                [&](Worker& worker) {
                                  behind->idle(worker);
                                  return kNever;
                                },
                            .changed = [&] { behind->map_changed(); }});
      LoopClosing loops(runtime, log, {}, laps->map, laps->places, mapping, mode);
      behind = &loops;
      mapping.start();
      loops.start();
      bool draining = false;
      if (park_while_draining) {
        runtime.spawn("parker", [&](Worker& worker) {
          while (!draining) worker.sleep_until(worker.now() + 1ms);
          mapping.park(true);
        });
      }
      runtime.spawn("driver", [&](Worker& worker) {
        int left = limit;
        bool closed = false;
        while (left-- > 0) {
          loops.mapped(worker, laps->add());
          EXPECT_TRUE(mapping.status().accepts) << "held only while closing";
          log.flush();
          if (!closed &&
              read_text(folder.path() / "events.jsonl").find("loop_closed") != std::string::npos) {
            closed = true;
            left = 2;
            if (on_closed) on_closed(worker, mapping, loops);
          }
          worker.sleep_until(worker.now() + 100ms);
        }
        const RunTime begin = worker.now();
        draining = true;
        loops.drained().wait(worker);
        drain_took = worker.now() - begin;
        runtime.stop();
      });
      simulator.run();
      runtime.join();
    }
    std::istringstream lines(read_text(folder.path() / "events.jsonl"));
    for (std::string line; std::getline(lines, line);)
      events.push_back(nlohmann::json::parse(line));
  }
  std::vector<nlohmann::json> of(const std::string& type, const std::string& stage = {}) const {
    std::vector<nlohmann::json> found;
    for (const auto& event : events)
      if (event["type"] == type && (stage.empty() || event["name"] == stage))
        found.push_back(event);
    return found;
  }

  /// Counts committed bundles: their last stage runs on the mapping side.
  std::size_t bundles_committed() const {
    const auto stages = of("stage", "global_bundle");
    return static_cast<std::size_t>(
        std::count_if(stages.begin(), stages.end(),
                      [](const auto& stage) { return stage["worker"] == "mapping"; }));
  }

  double bundle_us = 20'000;  ///< each stage of a global bundle
  bool park_while_draining = false;
  Duration drain_took{};
  std::unique_ptr<DriftedLaps> laps;
  std::vector<nlohmann::json> events;
};

TEST_F(LoopClosingTest, ALoopIsClosedAndTheBundleFollowsInTheBackground) {
  run(Mode::kWorker, 70);
  const auto closed = of("loop_closed");
  ASSERT_EQ(closed.size(), 1u);
  EXPECT_GE(closed[0]["matches"], 40);
  EXPECT_GT(closed[0]["fused"], 30);
  const auto bundle = of("stage", "global_bundle");
  ASSERT_GE(bundle.size(), 3u);
  for (const auto& stage : bundle) EXPECT_GT(stage["t_ns"], closed[0]["t_ns"]);
  // Computed on its own worker, committed on the mapping side.
  for (std::size_t i = 0; i + 1 < bundle.size(); ++i)
    EXPECT_EQ(bundle[i]["worker"], "global-bundle");
  EXPECT_EQ(bundle.back()["worker"], "mapping");
  for (int k = 0; k < 45; ++k) EXPECT_LT(laps->error_m(k), 0.05) << k;
}

TEST_F(LoopClosingTest, SequentiallyTheBundleRunsAtOnce) {
  run(Mode::kSequential, 70);
  ASSERT_EQ(of("loop_closed").size(), 1u);
  for (const auto& stage : of("stage")) EXPECT_EQ(stage["worker"], "driver");
  EXPECT_GE(of("stage", "global_bundle").size(), 3u);
  for (int k = 0; k < 45; ++k) EXPECT_LT(laps->error_m(k), 0.05) << k;
}

TEST_F(LoopClosingTest, AResetMakesARunningBundleWorthless) {
  run(Mode::kWorker, 70, [&](Worker& worker, LocalMapping& mapping, LoopClosing&) {
    worker.sleep_until(worker.now() + 30ms);  // the bundle is at its second step
    mapping.reset(laps->map).wait(worker);
  });
  ASSERT_EQ(of("loop_closed").size(), 1u);
  EXPECT_LE(of("stage", "global_bundle").size(), 3u);
  EXPECT_EQ(bundles_committed(), 0u);
}

TEST_F(LoopClosingTest, WhileMappingIsParkedNoBundleIsTakenOver) {
  SE3 parked, still;
  run(Mode::kWorker, 70, [&](Worker& worker, LocalMapping& mapping, LoopClosing&) {
    mapping.park(true);
    parked = laps->pose(10);
    worker.sleep_until(worker.now() + 10s);
    still = laps->pose(10);
    mapping.park(false);
  });
  ASSERT_EQ(of("loop_closed").size(), 1u);
  EXPECT_EQ(parked.t, still.t);
  EXPECT_EQ(bundles_committed(), 1u) << "once mapping goes on";
}

TEST_F(LoopClosingTest, NobodyWaitsForABundleOnceMappingIsParked) {
  bundle_us = 2e6;
  park_while_draining = true;
  run(Mode::kWorker, 70);
  ASSERT_EQ(of("loop_closed").size(), 1u);
  EXPECT_LE(drain_took, 1ms);
  EXPECT_EQ(bundles_committed(), 0u);
}

TEST_F(LoopClosingTest, ABundleThatIsNotDoneInTimeIsDropped) {
  RunTime asked{}, drained{};
  run(Mode::kWorker, 70, [&](Worker& worker, LocalMapping&, LoopClosing& loops) {
    asked = worker.now();
    if (!loops.drained().wait(worker, asked + 30ms))
      loops.cancel();  // the bundle is at its second step
    drained = worker.now();
  });
  ASSERT_EQ(of("loop_closed").size(), 1u);
  EXPECT_EQ(drained - asked, 30ms);
  EXPECT_LE(of("stage", "global_bundle").size(), 3u);
  EXPECT_EQ(bundles_committed(), 0u);
}

TEST_F(LoopClosingTest, WithoutALoopNothingButDetectionIsDone) {
  run(Mode::kWorker, 30);
  EXPECT_TRUE(of("loop_closed").empty());
  EXPECT_EQ(of("stage").size(), of("stage", "loop_detect").size());
}

/// The same with threads: the bundle runs while mapping continues.
TEST(LoopClosingLive, LoopsAreClosedAndTheLastBundleIsTakenOverBeforeTheEnd) {
  TemporaryFolder folder;
  DriftedLaps laps{DriftedLaps::Drift()};
  EventLog log(folder.path() / "events.jsonl", NodeRole::kMobile);
  log.set_clock([] { return RunTime(); });
  log.start(Duration::zero(), [] {});
  {
    LiveRuntime runtime(log);
    LoopClosing* behind = nullptr;
    std::atomic<int> maps_changed{0};
    LocalMapping mapping(runtime, log, {}, laps.map, IdSpace::kMobileMapper,
                         LocalMapping::Mode::kWorker,
                         {.prepare =
                              [&](Worker& worker, KeyFrameId keyframe) {
                                behind->mapped(worker, keyframe);
                                return false;  // no work of its own
                              },
                          .done = {},
                          .idle =
                              [&](Worker& worker) {
                                behind->idle(worker);
                                return kNever;
                              },
                          .changed = [&] { ++maps_changed; }});
    LoopClosing loops(runtime, log, {}, laps.map, laps.places, mapping,
                      LocalMapping::Mode::kWorker);
    behind = &loops;
    mapping.start();
    loops.start();
    runtime.spawn("driver", [&](Worker& worker) {
      for (int left = 70; left-- > 0;) {
        mapping.submit(worker, laps.add()).wait(worker);
      }
      mapping.drained().wait(worker);
      loops.drained().wait(worker);
      runtime.stop();
    });
    runtime.join();
    EXPECT_EQ(maps_changed, 0);
  }
  log.flush();
  int closed = 0, taken_over = 0;
  std::istringstream lines(read_text(folder.path() / "events.jsonl"));
  for (std::string line; std::getline(lines, line);) {
    const auto event = nlohmann::json::parse(line);
    closed += event["type"] == "loop_closed";
    taken_over += event["type"] == "stage" && event["name"] == "global_bundle" &&
                  event["worker"] == "mapping";
  }
  EXPECT_GE(closed, 1) << "how many hangs on how far keyframes are when the first is closed";
  EXPECT_GE(taken_over, 1) << "no newer loop made the last bundle worthless";
}

}  // namespace
}  // namespace slambed::testing
