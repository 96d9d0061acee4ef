// SPDX-License-Identifier: Apache-2.0
// The map lock makes other workers wait, in virtual time and live.
#include "node/map_lock.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "base/tests/temporary_folder.hpp"
#include "runtime/live/live_runtime.hpp"
#include "runtime/virtual/virtual_runtime.hpp"

namespace slambed::testing {
namespace {

using namespace std::chrono_literals;

class MapLockTest : public ::testing::Test {
 protected:
  MapLockTest() : path_(folder_.path() / "events.jsonl"), log_(path_, NodeRole::kMobile) {
    log_.set_clock([] { return RunTime::zero(); });
    log_.start(Duration::zero(), [] {});
  }
  std::vector<nlohmann::json> waits() {
    log_.flush();
    std::vector<nlohmann::json> found;
    std::ifstream file(path_);
    for (std::string line; std::getline(file, line);) {
      const auto event = nlohmann::json::parse(line);
      if (event["type"] == "map_wait") found.push_back(event);
    }
    return found;
  }

  TemporaryFolder folder_;
  std::filesystem::path path_;
  EventLog log_;
};

TEST_F(MapLockTest, WhoComesLaterWaitsUntilItIsReleased) {
  Simulator simulator;
  DeviceModel model;
  model.cores = 4;
  model.stages["write_back"] = {.a_us = 30'000};
  model.stages["track"] = {.a_us = 10'000};
  VirtualRuntime runtime(simulator, model, 1, log_);
  MapLock lock(runtime, log_);
  RunTime tracked{};
  runtime.spawn("mapping", [&](Worker& worker) {
    const MapLock::Hold hold(&lock, worker, "mapping");
    worker.stage("write_back", [](StageUnits&) {});
  });
  runtime.spawn("tracking", [&](Worker& worker) {
    worker.sleep_until(10ms);
    lock.acquire(worker, "tracking");
    worker.stage("track", [](StageUnits&) {});
    tracked = worker.now();
    lock.release();
  });
  simulator.run();
  runtime.join();
  EXPECT_EQ(tracked, 40ms);
  const auto found = waits();
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0]["worker"], "tracking");
  EXPECT_EQ(found[0]["wait_ms"], 20.0);
}

TEST_F(MapLockTest, OfNoLockNothingIsHeldAndAStoppedRunWaitsForNobody) {
  Simulator simulator;
  VirtualRuntime runtime(simulator, {}, 1, log_);
  MapLock lock(runtime, log_);
  bool came = false;
  runtime.spawn("holder", [&](Worker& worker) {
    const MapLock::Hold none(nullptr, worker, "nobody");
    lock.acquire(worker, "holder");
    worker.sleep_until(1s);
    runtime.stop();
  });
  runtime.spawn("waiter", [&](Worker& worker) {
    const MapLock::Hold hold(&lock, worker, "waiter");
    came = worker.stopping();
  });
  simulator.run();
  runtime.join();
  EXPECT_TRUE(came);
}

TEST_F(MapLockTest, LiveWorkersTakeTurns) {
  LiveRuntime runtime(log_);
  runtime.set_origin(monotonic_now());
  MapLock lock(runtime, log_);
  std::atomic<int> inside{0}, most{0};
  int turns = 0;  // changed only under the lock
  for (int i = 0; i < 4; ++i) {
    runtime.spawn("worker", [&](Worker& worker) {
      for (int turn = 0; turn < 200; ++turn) {
        const MapLock::Hold hold(&lock, worker, "worker");
        most = std::max(most.load(), ++inside);
        ++turns;
        --inside;
      }
    });
  }
  runtime.join();
  EXPECT_EQ(most, 1);
  EXPECT_EQ(turns, 800);
}

}  // namespace
}  // namespace slambed::testing
