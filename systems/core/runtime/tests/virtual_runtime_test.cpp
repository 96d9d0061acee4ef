// SPDX-License-Identifier: Apache-2.0
// Workers under the discrete-event clock: order, waiting, shared cores, charged stages, stopping.
#include "runtime/virtual/virtual_runtime.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/error.hpp"
#include "runtime/mailbox.hpp"

namespace slambed {
namespace {

using namespace std::chrono_literals;

struct RecordingObserver final : Observer {
  void stage(const StageRecord& r) override {
    log.push_back(std::string(r.worker) + ":" + std::string(r.name) + " " +
                  std::to_string(r.start.count() / 1000) + "+" +
                  std::to_string(r.wall.count() / 1000));
  }
  void message(const MessageRecord&) override {}
  void link(const ConnectionEvent&) override {}
  void refused(std::uint8_t, std::string_view) override {}
  std::vector<std::string> log;
};

DeviceModel device(int cores, double speed = 1, double jitter = 0) {
  DeviceModel model;
  model.cores = cores;
  model.speed = speed;
  model.stages["work"] = {.a_us = 1000, .b_us = 10, .c_us = 1, .jitter = jitter};
  return model;
}

void work(Worker& worker, double n1 = 0, double n2 = 0) {
  worker.stage("work", [&](StageUnits& units) { units = {n1, n2}; });
}

TEST(VirtualRuntime, StagesAreChargedByTheModel) {
  Simulator simulator;
  RecordingObserver observer;
  VirtualRuntime runtime(simulator, device(1, 0.5), 1, observer);
  runtime.spawn("a", [](Worker& w) { work(w, 50, 500); });
  simulator.run();
  runtime.join();
  EXPECT_EQ(observer.log, std::vector<std::string>{"a:work 0+4000"});
  EXPECT_EQ(runtime.cpu_time(), 4ms);
}

TEST(VirtualRuntime, AnAcceleratorWorksBesideTheCores) {
  Simulator simulator;
  RecordingObserver observer;
  DeviceModel model = device(1, 0.5);
  model.accelerators["gpu"] = {.lanes = 1, .speed = 2};
  model.stages["infer"] = {.a_us = 4000, .accelerator = "gpu"};
  VirtualRuntime runtime(simulator, model, 1, observer);
  runtime.spawn("core", [](Worker& w) { work(w); });
  for (const char* name : {"one", "two"}) {
    runtime.spawn(name, [](Worker& w) { w.stage("infer", [](StageUnits&) {}); });
  }
  simulator.run();
  // The core's stage takes 1 ms / 0.5. Two stages of 4 ms / 2 share the accelerator's only lane.
  EXPECT_EQ(observer.log,
            (std::vector<std::string>{"core:work 0+2000", "one:infer 0+4000", "two:infer 0+4000"}));
  EXPECT_EQ(runtime.cpu_time(), 2ms);
}

TEST(CostModel, AStageOnAnUnknownAcceleratorIsRefused) {
  DeviceModel model = device(1);
  model.stages["infer"] = {.a_us = 1, .accelerator = "gpu"};
  EXPECT_THROW(model.check(), Error);
  model.accelerators["gpu"] = {.lanes = 0};
  EXPECT_THROW(model.check(), Error);
}

TEST(VirtualRuntime, AFrozenNodeGoesOnWhereItWas) {
  Simulator simulator;
  RecordingObserver observer;
  VirtualRuntime runtime(simulator, device(1), 1, observer);
  const auto signal = runtime.make_signal();
  RunTime slept{}, woken{};
  runtime.spawn("busy", [](Worker& w) {
    for (int i = 0; i < 3; ++i) work(w);
  });
  runtime.spawn("sleeper", [&](Worker& w) {
    w.sleep_until(5ms);
    slept = w.now();
  });
  runtime.spawn("waiter", [&](Worker& w) {
    EXPECT_TRUE(w.wait(*signal, signal->ticket(), kNever));
    woken = w.now();
  });
  simulator.at(1500us, [&] { runtime.freeze(true); });
  simulator.at(6ms, [&] { signal->notify(); });
  simulator.at(7ms, [&] { EXPECT_EQ(runtime.cpu_time(), 1500us); });
  simulator.at(10ms, [&] { runtime.freeze(false); });
  simulator.run();
  runtime.join();
  // The second stage started at 1 ms, was frozen from 1.5 to 10 ms and then had 0.5 ms left.
  EXPECT_EQ(observer.log, (std::vector<std::string>{"busy:work 0+1000", "busy:work 1000+9500",
                                                    "busy:work 10500+1000"}));
  EXPECT_EQ(slept, 10ms);
  EXPECT_EQ(woken, 10ms);
}

TEST(VirtualRuntime, WorkersShareTheCoresFairly) {
  Simulator simulator;
  RecordingObserver observer;
  VirtualRuntime runtime(simulator, device(2), 1, observer);
  for (const char* name : {"a", "b", "c"}) runtime.spawn(name, [](Worker& w) { work(w); });
  simulator.run();
  // Three 1 ms stages on two cores: each gets two thirds of a core.
  EXPECT_EQ(observer.log,
            (std::vector<std::string>{"a:work 0+1500", "b:work 0+1500", "c:work 0+1500"}));
  EXPECT_EQ(runtime.cpu_time(), 3ms);
}

TEST(VirtualRuntime, ALateStageSlowsTheRunningOneOnlyWhileBothRun) {
  Simulator simulator;
  RecordingObserver observer;
  VirtualRuntime runtime(simulator, device(1), 1, observer);
  runtime.spawn("early", [](Worker& w) { work(w); });
  runtime.spawn("late", [](Worker& w) {
    w.sleep_until(500us);
    work(w);
  });
  simulator.run();
  EXPECT_EQ(observer.log, (std::vector<std::string>{"early:work 0+1500", "late:work 500+1500"}));
}

TEST(VirtualRuntime, ABackgroundLoadTakesItsPartOfTheCores) {
  const auto walls = [](int cores, double background, int workers) {
    Simulator simulator;
    RecordingObserver observer;
    DeviceModel model = device(cores);
    model.background = background;
    VirtualRuntime runtime(simulator, model, 1, observer);
    for (int i = 0; i < workers; ++i) runtime.spawn("w", [](Worker& w) { work(w); });
    simulator.run();
    runtime.join();
    return std::pair(observer.log.at(0), runtime.cpu_time());
  };
  // With enough cores no stage is slower. The background load counts in the device's CPU time.
  EXPECT_EQ(walls(4, 0.5, 3), std::pair(std::string("w:work 0+1000"), Duration(3500us)));
  // Two threads on one core get half of it each. A load of 0.25 gets all that it wants.
  EXPECT_EQ(walls(1, 1, 1), std::pair(std::string("w:work 0+2000"), Duration(2ms)));
  EXPECT_EQ(walls(1, 0.25, 1).first, "w:work 0+1333");
  // Three stages want a core each and two load threads 0.9 each: of four cores each gets 0.8.
  EXPECT_EQ(walls(4, 1.8, 3).first, "w:work 0+1250");
  EXPECT_EQ(walls(4, 0, 3), std::pair(std::string("w:work 0+1000"), Duration(3ms)));
}

TEST(CostModel, ABackgroundLoadBelowNothingIsRefused) {
  DeviceModel model = device(1);
  model.background = -0.1;
  EXPECT_THROW(model.check(), Error);
}

TEST(VirtualRuntime, AMailboxHandsItemsOnAtTheInstantTheyArePut) {
  Simulator simulator;
  RecordingObserver observer;
  VirtualRuntime runtime(simulator, device(1), 1, observer);
  Mailbox<int> mailbox(runtime, 1);
  std::vector<std::pair<int, RunTime>> taken;
  std::vector<int> dropped;
  runtime.spawn("producer", [&](Worker& w) {
    for (int i = 0; i < 6; ++i) {
      w.sleep_until(i * 400us);
      if (auto old = mailbox.put(i)) dropped.push_back(*old);
    }
  });
  runtime.spawn("consumer", [&](Worker& w) {
    while (auto item = mailbox.take(w, w.now() + 10ms)) {
      taken.emplace_back(*item, w.now());
      work(w);
    }
    EXPECT_EQ(w.now(), 4ms + 10ms);
  });
  simulator.run();
  // An item takes 1 ms, one comes every 0.4 ms, the newest wins: 0 at once, then 2, 4 and 5.
  const std::vector<std::pair<int, RunTime>> expected{{0, 0ms}, {2, 1ms}, {4, 2ms}, {5, 3ms}};
  EXPECT_EQ(taken, expected);
  EXPECT_EQ(dropped, (std::vector<int>{1, 3}));
}

TEST(VirtualRuntime, ANotifyBetweenTicketAndWaitIsNotLost) {
  Simulator simulator;
  RecordingObserver observer;
  VirtualRuntime runtime(simulator, device(1), 1, observer);
  auto signal = runtime.make_signal();
  runtime.spawn("a", [&](Worker& w) {
    const auto ticket = signal->ticket();
    signal->notify();
    EXPECT_TRUE(w.wait(*signal, ticket, kNever));
    EXPECT_FALSE(w.wait(*signal, signal->ticket(), w.now() + 1ms));
    EXPECT_EQ(w.now(), 1ms);
  });
  simulator.run();
  runtime.join();
}

TEST(VirtualRuntime, StopWakesEveryWaiter) {
  Simulator simulator;
  RecordingObserver observer;
  VirtualRuntime runtime(simulator, device(1), 1, observer);
  Mailbox<int> mailbox(runtime);
  int ended = 0;
  for (int i = 0; i < 3; ++i) {
    runtime.spawn("waiter", [&](Worker& w) {
      EXPECT_FALSE(mailbox.take(w));
      EXPECT_TRUE(w.stopping());
      ++ended;
    });
  }
  runtime.spawn("stopper", [&](Worker& w) {
    w.sleep_until(7ms);
    runtime.stop();
  });
  simulator.run();
  EXPECT_EQ(ended, 3);
  EXPECT_EQ(simulator.now(), 7ms);
}

TEST(VirtualRuntime, AnExceptionStopsTheNodeAndComesOutOfJoin) {
  Simulator simulator;
  RecordingObserver observer;
  VirtualRuntime runtime(simulator, device(1), 1, observer);
  runtime.spawn("bad", [](Worker&) { throw bad_input("no good"); });
  runtime.spawn("other", [](Worker& w) { w.sleep_until(kNever); });
  simulator.run();
  EXPECT_THROW(runtime.join(), Error);
}

TEST(VirtualRuntime, AnUnknownStageIsAnErrorOfTheDeviceFile) {
  Simulator simulator;
  RecordingObserver observer;
  VirtualRuntime runtime(simulator, device(1), 1, observer);
  runtime.spawn("a", [](Worker& w) { w.stage("unheard", [](StageUnits&) {}); });
  simulator.run();
  EXPECT_THROW(runtime.join(), Error);
}

TEST(VirtualRuntime, AStuckRunEndsAndSaysWhoWaited) {
  Simulator simulator;
  RecordingObserver observer;
  VirtualRuntime runtime(simulator, device(1), 1, observer);
  Mailbox<int> mailbox(runtime);
  runtime.spawn("lonely", [&](Worker& w) { mailbox.take(w); });
  try {
    simulator.run();
    FAIL() << "must throw";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("lonely"), std::string::npos) << error.what();
  }
}

TEST(Simulator, EndsThoughItNeverRan) {
  bool ran = false;
  RecordingObserver observer;
  {
    Simulator simulator;
    VirtualRuntime runtime(simulator, device(1), 1, observer);
    runtime.spawn("never", [&](Worker&) { ran = true; });
  }
  EXPECT_FALSE(ran);
}

TEST(Simulator, UnwindsTheWorkersOfANodeThatStaysFrozen) {
  Simulator simulator;
  RecordingObserver observer;
  VirtualRuntime runtime(simulator, device(1), 1, observer);
  const auto signal = runtime.make_signal();
  int unwound = 0;
  struct AtEnd {
    int& count;
    ~AtEnd() { ++count; }
  };
  runtime.spawn("waits", [&](Worker& w) {
    const AtEnd at_end{unwound};
    w.wait(*signal, signal->ticket(), kNever);
  });
  runtime.spawn("works", [&](Worker& w) {
    const AtEnd at_end{unwound};
    for (int i = 0; i < 5; ++i) {
      work(w);
      w.sleep_until(w.now() + 1ms);
    }
  });
  simulator.at(2500us, [&] { runtime.freeze(true); });
  EXPECT_THROW(simulator.run(), Error);
  EXPECT_EQ(unwound, 2);
}

TEST(Simulator, WhatAnActionThrowsLeavesTheRunAndNoTaskBehind) {
  Simulator simulator;
  RecordingObserver observer;
  VirtualRuntime runtime(simulator, device(1), 1, observer);
  const auto signal = runtime.make_signal();
  bool waited = false;
  runtime.spawn("waits", [&](Worker& w) {
    w.wait(*signal, signal->ticket(), kNever);
    waited = true;
  });
  simulator.at(1ms, [] { throw std::runtime_error("an action"); });
  EXPECT_THROW(simulator.run(), std::runtime_error);
  EXPECT_FALSE(waited);
}

TEST(VirtualRuntime, EqualSeedsGiveEqualRunsAndOtherSeedsDoNot) {
  const auto run = [](std::uint64_t seed) {
    Simulator simulator;
    RecordingObserver observer;
    VirtualRuntime runtime(simulator, device(2, 1, 0.3), seed, observer);
    for (const char* name : {"a", "b", "c"}) {
      runtime.spawn(name, [](Worker& w) {
        for (int i = 0; i < 20; ++i) work(w, i);
      });
    }
    simulator.run();
    return observer.log;
  };
  EXPECT_EQ(run(1), run(1));
  EXPECT_NE(run(1), run(2));
}

TEST(CostModel, JitterHasTheAskedSpread) {
  const DeviceModel model = device(1, 1, 0.2);
  double sum = 0, squares = 0;
  constexpr int kDraws = 20000;
  for (int i = 0; i < kDraws; ++i) {
    const double log_factor = std::log(to_ms(model.charge("work", {}, 5, i)));
    sum += log_factor;
    squares += log_factor * log_factor;
  }
  const double mean = sum / kDraws;
  EXPECT_NEAR(mean, 0, 0.005);  // three standard errors: 3 * 0.2 / sqrt(20000)
  EXPECT_NEAR(std::sqrt(squares / kDraws - mean * mean), 0.2, 0.004);
}

}  // namespace
}  // namespace slambed
