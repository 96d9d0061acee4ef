// SPDX-License-Identifier: Apache-2.0
#include "runtime/mailbox.hpp"

#include <gtest/gtest.h>

#include "runtime/live/live_runtime.hpp"
#include "runtime/tests/recorder.hpp"

namespace slambed {
namespace {

using namespace std::chrono_literals;

TEST(Mailbox, NewestWinsAndHandsBackTheOldest) {
  Recorder recorder;
  LiveRuntime runtime(recorder);
  Mailbox<int> box(runtime, 1);
  EXPECT_FALSE(box.put(1));
  EXPECT_EQ(box.put(2), 1);
  EXPECT_EQ(box.try_take(), 2);
  EXPECT_FALSE(box.try_take());
}

TEST(Mailbox, UnboundedKeepsOrder) {
  Recorder recorder;
  LiveRuntime runtime(recorder);
  Mailbox<int> box(runtime);
  for (int i = 0; i < 100; ++i) EXPECT_FALSE(box.put(i));
  for (int i = 0; i < 100; ++i) EXPECT_EQ(box.try_take(), i);
}

TEST(Mailbox, TakeGivesUpAtTheDeadlineAndAtTheEndOfTheRun) {
  Recorder recorder;
  LiveRuntime runtime(recorder);
  Mailbox<int> box(runtime);
  bool timed_out = false, ended = false;
  runtime.spawn("a", [&](Worker& w) { timed_out = !box.take(w, w.now() + 5ms); });
  runtime.spawn("b", [&](Worker& w) { ended = !box.take(w); });
  runtime.spawn("c", [&](Worker& w) {
    w.sleep_until(w.now() + 20ms);
    runtime.stop();
  });
  runtime.join();
  EXPECT_TRUE(timed_out);
  EXPECT_TRUE(ended);
}

TEST(Mailbox, ItemsCrossThreads) {
  Recorder recorder;
  LiveRuntime runtime(recorder);
  Mailbox<int> box(runtime);
  long sum = 0;
  runtime.spawn("producer", [&](Worker&) {
    for (int i = 1; i <= 1000; ++i) box.put(i);
  });
  runtime.spawn("consumer", [&](Worker& w) {
    for (int i = 0; i < 1000; ++i) sum += *box.take(w);
  });
  runtime.join();
  EXPECT_EQ(sum, 500500);
}

}  // namespace
}  // namespace slambed
