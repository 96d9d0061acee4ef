// SPDX-License-Identifier: Apache-2.0
#include "runtime/live/live_runtime.hpp"

#include <gtest/gtest.h>
#include <pthread.h>

#include <atomic>
#include <thread>

#include "base/error.hpp"
#include "runtime/tests/recorder.hpp"

namespace slambed {
namespace {

using namespace std::chrono_literals;

TEST(LiveRuntime, RunTimeCountsFromTheOrigin) {
  Recorder recorder;
  LiveRuntime runtime(recorder);
  runtime.set_origin(monotonic_now() + 1h);
  EXPECT_LT(runtime.now(), -59min);
  EXPECT_GT(runtime.now(), -61min);
}

TEST(LiveRuntime, NotifyBetweenTicketAndWaitIsNotLost) {
  Recorder recorder;
  LiveRuntime runtime(recorder);
  auto signal = runtime.make_signal();
  bool woken = false;
  runtime.spawn("waiter", [&](Worker& worker) {
    const auto ticket = signal->ticket();
    signal->notify();
    woken = worker.wait(*signal, ticket, kNever);
  });
  runtime.join();
  EXPECT_TRUE(woken);
}

TEST(LiveRuntime, WaitEndsAtTheDeadline) {
  Recorder recorder;
  LiveRuntime runtime(recorder);
  runtime.set_origin(monotonic_now());
  auto signal = runtime.make_signal();
  bool notified = true;
  RunTime when{};
  runtime.spawn("waiter", [&](Worker& worker) {
    notified = worker.wait(*signal, signal->ticket(), worker.now() + 20ms);
    when = worker.now();
  });
  runtime.join();
  EXPECT_FALSE(notified);
  EXPECT_GE(when, 20ms);
}

TEST(LiveRuntime, StopWakesWaitersAndSleepers) {
  Recorder recorder;
  LiveRuntime runtime(recorder);
  auto signal = runtime.make_signal();
  std::atomic<int> begun{0}, ended{0};
  std::atomic<bool> notified{false};
  runtime.spawn("waiter", [&](Worker& worker) {
    const auto ticket = signal->ticket();
    ++begun;
    notified = worker.wait(*signal, ticket, kNever);
    ended += worker.stopping();
  });
  runtime.spawn("sleeper", [&](Worker& worker) {
    ++begun;
    worker.sleep_until(kNever);
    ended += worker.stopping();
  });
  while (begun < 2) std::this_thread::yield();
  std::this_thread::sleep_for(20ms);  // after this both workers sleep
  EXPECT_EQ(ended, 0);
  runtime.stop();
  runtime.join();
  EXPECT_EQ(ended, 2);
  EXPECT_FALSE(notified);
}

TEST(LiveRuntime, FirstExceptionStopsTheRunAndComesOutOfJoin) {
  Recorder recorder;
  LiveRuntime runtime(recorder);
  runtime.spawn("sleeper", [](Worker& worker) { worker.sleep_until(kNever); });
  runtime.spawn("thrower", [](Worker&) { throw bad_input("worker failed"); });
  EXPECT_THROW(runtime.join(), Error);
  runtime.join();  // the error is reported only once
}

TEST(LiveRuntime, StagesAreMeasuredAndNamed) {
  Recorder recorder;
  LiveRuntime runtime(recorder);
  std::string thread_name(16, '\0');
  int result = 0;
  runtime.spawn("a-long-worker-name", [&](Worker& worker) {
    pthread_getname_np(pthread_self(), thread_name.data(), thread_name.size());
    result = worker.stage("extract", [&](StageUnits& units) {
      units.n1 = 3;
      worker.sleep_until(worker.now() + 10ms);
      return 7;
    });
  });
  runtime.join();
  EXPECT_EQ(result, 7);
  EXPECT_EQ(recorder.stages(), std::vector<std::string>{"a-long-worker-name/extract"});
  EXPECT_GE(recorder.last_wall(), 10ms);
  EXPECT_LT(recorder.last_cpu(), recorder.last_wall());
  EXPECT_STREQ(thread_name.c_str(), "a-long-worker-n");
}

TEST(LiveRuntime, StageIsRecordedWhenWorkThrows) {
  Recorder recorder;
  LiveRuntime runtime(recorder);
  runtime.spawn("w", [](Worker& worker) {
    worker.stage("track", [](StageUnits&) { throw bad_input("inside"); });
  });
  EXPECT_THROW(runtime.join(), Error);
  EXPECT_EQ(recorder.stages().size(), 1u);
}

}  // namespace
}  // namespace slambed
