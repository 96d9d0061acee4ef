// SPDX-License-Identifier: Apache-2.0
// Live stages at a device's pace. On a busy host a thread may wait for a CPU for any time, so the
// tests check only CPU times, lower bounds of wall times, and charges.
#include "runtime/live/pace.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.hpp"
#include "runtime/live/background_load.hpp"
#include "runtime/live/live_runtime.hpp"
#include "runtime/virtual/virtual_runtime.hpp"

namespace slambed {
namespace {

using namespace std::chrono_literals;

struct Stages final : Observer {
  void stage(const StageRecord& record) override {
    const std::lock_guard lock(mutex);
    all.push_back(record);
  }
  void message(const MessageRecord&) override {}
  void link(const ConnectionEvent&) override {}
  void refused(std::uint8_t, std::string_view) override {}
  std::mutex mutex;
  std::vector<StageRecord> all;
};

DeviceModel device() {
  DeviceModel model;
  model.accelerators["gpu"] = {.lanes = 1, .speed = 2};
  model.stages["work"] = {.a_us = 10'000, .b_us = 1'000};
  model.stages["none"] = {};
  model.stages["infer"] = {.a_us = 20'000, .accelerator = "gpu"};
  model.stages["jittery"] = {.a_us = 100, .b_us = 3, .c_us = 1, .jitter = 0.4};
  return model;
}

/// Runs one worker to its end and collects its stages in `stages`.
void run(Stages& stages, const PaceOptions& options, const std::function<void(Worker&)>& body) {
  LiveRuntime runtime(stages, options);
  runtime.set_origin(monotonic_now());
  runtime.spawn("worker", body);
  runtime.join();
}

void compute(Duration cpu) {
  burn_until(thread_cpu_time() + cpu, [] { return false; });
}

TEST(Pace, AStageHasTheDevicesShareOfACpuAndNoLessThanItsTime) {
  for (const double share : {1.0, 0.25}) {
    Stages stages;
    run(stages, {.device = device(), .share = share},
        [](Worker& worker) { worker.stage("work", [](StageUnits& units) { units.n1 = 20; }); });
    ASSERT_EQ(stages.all.size(), 1u);
    const StageRecord& stage = stages.all[0];
    ASSERT_TRUE(stage.paced);
    EXPECT_EQ(stage.paced->charged, 30ms);
    EXPECT_FALSE(stage.paced->missed);
    EXPECT_LT(stage.paced->work, 1ms);
    EXPECT_GE(stage.wall, 30ms);
    EXPECT_GE(to_ms(stage.cpu), share * 30);
    EXPECT_LT(to_ms(stage.cpu), share * 30 + 3);
  }
}

TEST(Pace, WhatTheWorkTookIsNotBurntOnTop) {
  Stages stages;
  run(stages, {.device = device()}, [](Worker& worker) {
    worker.stage("work", [](StageUnits& units) {
      units.n1 = 20;
      compute(20ms);
    });
  });
  const StageRecord& stage = stages.all.at(0);
  EXPECT_GE(stage.paced->work, 20ms);
  EXPECT_FALSE(stage.paced->missed);
  EXPECT_GE(stage.cpu, 30ms);
  EXPECT_LT(stage.cpu, 33ms);
}

TEST(Pace, WorkThatTakesLongerThanTheDeviceIsToldAndLeftAsItIs) {
  Stages stages;
  run(stages, {.device = device(), .share = 0.5}, [](Worker& worker) {
    worker.stage("work", [](StageUnits&) { compute(8ms); });  // allowed: half of 10 ms
    worker.stage("none", [](StageUnits&) {});
  });
  ASSERT_EQ(stages.all.size(), 2u);
  EXPECT_TRUE(stages.all[0].paced->missed);
  EXPECT_EQ(stages.all[0].paced->charged, 10ms);
  EXPECT_GE(stages.all[0].paced->work, 8ms);
  EXPECT_LT(stages.all[0].cpu, 10ms);
  // A stage without cost may still take some microseconds here.
  EXPECT_FALSE(stages.all[1].paced->missed);
  EXPECT_EQ(stages.all[1].paced->charged, 0ms);
}

TEST(Pace, AnEffectIsSeenOnlyWhenTheDeviceWouldBeDone) {
  Stages stages;
  RunTime begun{}, seen{};
  run(stages, {.device = device()}, [&](Worker& worker) {
    begun = worker.now();
    worker.stage(
        "work", [](StageUnits&) { return 1; }, [&](int) { seen = worker.now(); });
  });
  EXPECT_GE(seen - begun, 10ms);
}

TEST(Pace, AnAcceleratorTakesTimeAndNoCpu) {
  Stages stages;
  run(stages, {.device = device()},
      [](Worker& worker) { worker.stage("infer", [](StageUnits&) {}); });
  const StageRecord& stage = stages.all.at(0);
  EXPECT_EQ(stage.paced->charged, 10ms);
  EXPECT_GE(stage.wall, 10ms);
  EXPECT_LT(stage.cpu, 3ms);
}

TEST(Pace, TheEndOfTheRunEndsAStage) {
  Stages stages;
  DeviceModel slow = device();
  slow.stages["work"].a_us = 3.6e9;
  LiveRuntime runtime(stages, PaceOptions{.device = slow, .share = 1e-6});
  runtime.set_origin(monotonic_now());
  std::atomic<bool> begun{false};
  runtime.spawn("worker",
                [&](Worker& worker) { worker.stage("work", [&](StageUnits&) { begun = true; }); });
  while (!begun) std::this_thread::yield();
  runtime.stop();
  runtime.join();
  EXPECT_EQ(stages.all.at(0).paced->charged, 1h);
  EXPECT_LT(stages.all.at(0).wall, 1h);
}

TEST(Pace, ChargesAreThoseOfTheVirtualEngine) {
  const auto body = [](Worker& worker) {
    for (int i = 0; i < 20; ++i)
      worker.stage("jittery", [&](StageUnits& units) { units = {1.0 * i, 2.0 * i}; });
  };
  Stages live, simulated;
  run(live, {.device = device(), .share = 0.01, .seed = 42}, body);
  Simulator simulator;
  VirtualRuntime runtime(simulator, device(), 42, simulated);
  runtime.spawn("worker", body);
  simulator.run();
  runtime.join();
  ASSERT_EQ(live.all.size(), 20u);
  for (std::size_t i = 0; i < live.all.size(); ++i)
    EXPECT_EQ(live.all[i].paced->charged, simulated.all[i].cpu) << i;
}

TEST(Pace, AStageWithoutACostAndAWrongShareAreBadInput) {
  Stages stages;
  EXPECT_THROW(run(stages, {.device = device()},
                   [](Worker& worker) { worker.stage("unknown", [](StageUnits&) {}); }),
               Error);
  EXPECT_TRUE(stages.all.empty());
  EXPECT_THROW(Pace({.device = device(), .share = 0}), Error);
  EXPECT_THROW(Pace({.device = device(), .share = 1.5}), Error);
}

TEST(LiveRuntime, WithoutAPaceStagesAreNotHeldUp) {
  Stages stages;
  LiveRuntime runtime(stages);
  runtime.spawn("worker", [](Worker& worker) { worker.stage("unknown", [](StageUnits&) {}); });
  runtime.join();
  EXPECT_FALSE(stages.all.at(0).paced);
}

TEST(BackgroundLoad, TakesItsShareOfACpuUntilTheRunStops) {
  Stages stages;
  LiveRuntime runtime(stages);
  runtime.set_origin(monotonic_now());
  const auto process_cpu = [] {
    timespec ts{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &ts);
    return std::chrono::seconds(ts.tv_sec) + Duration(ts.tv_nsec);
  };
  const Duration before = process_cpu();
  const RunTime begin = runtime.now();
  spawn_background_load(runtime, 1.5, 0.1);  // two threads, 0.15 of a CPU
  std::this_thread::sleep_for(400ms);
  runtime.stop();
  runtime.join();
  const double took = to_ms(process_cpu() - before), lasted = to_ms(runtime.now() - begin);
  EXPECT_LT(took, 0.15 * lasted + 10);
  EXPECT_GT(took, 6);  // at least two periods of both threads, even on a busy host
}

}  // namespace
}  // namespace slambed
