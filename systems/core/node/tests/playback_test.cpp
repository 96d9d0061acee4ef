// SPDX-License-Identifier: Apache-2.0
#include "node/playback.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/error.hpp"
#include "base/tests/temporary_folder.hpp"
#include "runtime/virtual/virtual_runtime.hpp"

namespace slambed {
namespace {

using namespace std::chrono_literals;

std::vector<std::int64_t> thirty_hertz(int frames) {
  std::vector<std::int64_t> times;
  for (int i = 0; i < frames; ++i) times.push_back(i * 1'000'000'000LL / 30);
  return times;
}

std::vector<std::uint64_t> indices(const Playlist& playlist) {
  std::vector<std::uint64_t> list;
  for (const auto& frame : playlist.frames()) list.push_back(frame.index);
  return list;
}

TEST(Playlist, KeepsEveryKthFrameOfTheWindowAndStartsAtZero) {
  const auto times = thirty_hertz(60);
  const Playlist all(times, 30, {});
  EXPECT_EQ(all.frames().size(), 60u);
  EXPECT_EQ(all.played_fps(), 30);
  const Playlist third(times, 30, {.fps = 10.0});
  EXPECT_EQ(indices(third), (std::vector<std::uint64_t>{0,  3,  6,  9,  12, 15, 18, 21, 24, 27,
                                                        30, 33, 36, 39, 42, 45, 48, 51, 54, 57}));
  EXPECT_EQ(third.played_fps(), 10);
  const Playlist window(times, 30, {.fps = 15.0, .start_s = 0.5, .end_s = 0.7});
  EXPECT_EQ(indices(window), (std::vector<std::uint64_t>{15, 17, 19}));
  EXPECT_EQ(window.frames()[0].due, 0ns);
  EXPECT_NEAR(window.frames()[1].seq_s(), 2 / 30.0, 1e-9);
  EXPECT_EQ(Playlist(times, 30, {.fps = 100.0}).frames().size(), 60u);  // not faster than recorded
  EXPECT_EQ(Playlist(times, 30, {.fps = 12.0}).played_fps(), 10);       // 2.5 is rounded up
  EXPECT_THROW(Playlist(times, 30, {.start_s = 5}), Error);
}

/// Tracks each frame for a fixed time in virtual time; the result does not depend on the machine.
struct Played {
  std::vector<std::uint64_t> taken;
  std::vector<double> taken_ms, waited_ms;
  std::vector<std::uint64_t> dropped;
};

Played play(FrameFeed& (*make)(Runtime&, const Playlist&, EventLog&, std::unique_ptr<FrameFeed>&),
            const Playlist& playlist, Duration tracking) {
  testing::TemporaryFolder folder;
  EventLog log(folder.path() / "events.jsonl", NodeRole::kMobile);
  Simulator simulator;
  VirtualRuntime runtime(simulator, {}, 1, log);
  log.set_clock([&] { return runtime.now(); });
  log.start(0ns, [] {});
  std::unique_ptr<FrameFeed> owner;
  FrameFeed& feed = make(runtime, playlist, log, owner);
  Played played;
  feed.start();
  runtime.spawn("tracking", [&](Worker& worker) {
    while (const auto frame = feed.next(worker)) {
      played.taken.push_back(frame->played.index);
      played.taken_ms.push_back(to_ms(frame->dequeued));
      played.waited_ms.push_back(to_ms(frame->dequeued - frame->offered));
      worker.sleep_until(worker.now() + tracking);
    }
    runtime.stop();
  });
  simulator.run();
  runtime.join();
  EXPECT_EQ(feed.offered(), playlist.frames().size());
  log.flush();
  std::istringstream text(testing::read_text(folder.path() / "events.jsonl"));
  for (std::string line; std::getline(text, line);) {
    played.dropped.push_back(nlohmann::json::parse(line)["frame"].get<std::uint64_t>());
  }
  return played;
}

FrameFeed& realtime(Runtime& runtime, const Playlist& playlist, EventLog& log,
                    std::unique_ptr<FrameFeed>& owner) {
  owner = std::make_unique<RealtimeFeed>(runtime, playlist, log);
  return *owner;
}
FrameFeed& paced(Runtime&, const Playlist& playlist, EventLog&, std::unique_ptr<FrameFeed>& owner) {
  owner = std::make_unique<EveryFrameFeed>(playlist, true);
  return *owner;
}
FrameFeed& unpaced(Runtime&, const Playlist& playlist, EventLog&,
                   std::unique_ptr<FrameFeed>& owner) {
  owner = std::make_unique<EveryFrameFeed>(playlist, false);
  return *owner;
}

std::vector<std::int64_t> every_100_ms(int frames) {
  std::vector<std::int64_t> times;
  for (int i = 0; i < frames; ++i) times.push_back(i * 100'000'000LL);
  return times;
}

TEST(Playback, RealtimeDropsAllButTheNewestWhileTrackingIsBusy) {
  const auto times = every_100_ms(8);
  const Played played = play(realtime, Playlist(times, 10, {}), 250ms);
  // Taken at 0; at 250 frame 2 is the newest (1 was replaced at 200); at 500 frame 5 has just come.
  EXPECT_EQ(played.taken.front(), 0u);
  EXPECT_EQ(played.taken[1], 2u);
  EXPECT_EQ(played.taken.back(), 7u);  // the last frame is never lost
  EXPECT_EQ(played.dropped.front(), 1u);
  EXPECT_EQ(played.taken.size() + played.dropped.size(), 8u);
  EXPECT_DOUBLE_EQ(played.waited_ms[1], 50);
}

TEST(Playback, RealtimeTakesEachFrameAtItsTimeWhenTrackingIsFast) {
  const Played played = play(realtime, Playlist(every_100_ms(5), 10, {}), 20ms);
  EXPECT_EQ(played.taken, (std::vector<std::uint64_t>{0, 1, 2, 3, 4}));
  EXPECT_EQ(played.taken_ms, (std::vector<double>{0, 100, 200, 300, 400}));
  EXPECT_TRUE(played.dropped.empty());
}

TEST(Playback, EveryFrameWaitsForTrackingButNotLessThanTheFramesTime) {
  const Played slow = play(paced, Playlist(every_100_ms(4), 10, {}), 250ms);
  EXPECT_EQ(slow.taken_ms, (std::vector<double>{0, 250, 500, 750}));
  const Played fast = play(paced, Playlist(every_100_ms(4), 10, {}), 20ms);
  EXPECT_EQ(fast.taken_ms, (std::vector<double>{0, 100, 200, 300}));
  const Played sequential = play(unpaced, Playlist(every_100_ms(4), 10, {}), 20ms);
  EXPECT_EQ(sequential.taken_ms, (std::vector<double>{0, 20, 40, 60}));
}

}  // namespace
}  // namespace slambed
