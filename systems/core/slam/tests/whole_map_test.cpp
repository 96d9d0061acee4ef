// SPDX-License-Identifier: Apache-2.0
// Work that grows with the map does not block tracking.
#include <gtest/gtest.h>

#include <pthread.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <ctime>
#include <fstream>
#include <future>
#include <string>
#include <thread>

#include "map/tests/busy_writer.hpp"
#include "map/tests/map_fixture.hpp"
#include "slam/global_bundle.hpp"
#include "slam/place_index.hpp"
#include "slam/tests/scene_vocabulary.hpp"
#include "slam/tests/synthetic_scene.hpp"

namespace slambed::testing {
namespace {

constexpr std::uint64_t kKeyFrames = 30, kPointsEach = 200;

/// Each keyframe sees its own points and those of the previous one.
void fill(Map& map) {
  MapDelta delta;
  for (std::uint64_t n = 1; n <= kKeyFrames * kPointsEach; ++n)
    delta.points.push_back(new_point(n));
  for (std::uint64_t k = 1; k <= kKeyFrames; ++k) {
    auto points = points_from((k - 1) * kPointsEach + 1, kPointsEach);
    if (k > 1) {
      const auto before = points_from((k - 2) * kPointsEach + 1, kPointsEach);
      points.insert(points.end(), before.begin(), before.end());
    }
    delta.keyframes.push_back(new_keyframe(k, points));
  }
  map.commit(delta);
}

TEST(WholeMap, OthersChangeItWhileItIsCollectedForABundle) {
  Map map;
  fill(map);
  const WholeMap before = collect(map);
  ASSERT_EQ(before.points.size(), kKeyFrames * kPointsEach);
  EXPECT_EQ(before.keyframes.back(), kf(1)) << "the origin";
  EXPECT_EQ(before.problem.observations.size(), (2 * kKeyFrames - 1) * kPointsEach);
  // Both ends of the map always move together; two separate reads would see them apart.
  BusyWriter writer(map, [](std::uint32_t number) {
    const Eigen::Vector3d place(number, 0, 2);
    MapDelta delta;
    delta.positions = {{pt(1), place, number}, {pt(kKeyFrames * kPointsEach), place, number}};
    return delta;
  });
  EXPECT_TRUE(BusyWriter::until([&] {
    const WholeMap whole = collect(map);
    return whole.problem.p_w.front().x() != whole.problem.p_w.back().x();
  }));
}

TEST(WholeMap, WhatComesAndGoesWhileItIsCollectedLeavesAProblemThatCanBeSolved) {
  Map map;
  fill(map);
  // A keyframe and its points are added and removed repeatedly.
  BusyWriter writer(map, [](std::uint32_t number) {
    MapDelta delta;
    const std::uint64_t fresh = kKeyFrames * kPointsEach + number * 10;
    if (number % 2 == 1) {
      for (const std::uint64_t n : points_from(fresh, 10)) delta.points.push_back(new_point(n));
      auto sees = points_from(fresh, 10);
      sees.push_back(kPointsEach);
      delta.keyframes = {new_keyframe(kKeyFrames + number, sees)};
    } else {
      delta.culled_keyframes = {kf(kKeyFrames + number - 1)};
    }
    return delta;
  });
  const int begun = writer.commits();
  int collected = 0;
  EXPECT_TRUE(BusyWriter::until([&] {
    const WholeMap whole = collect(map);
    const BundleProblem& problem = whole.problem;
    EXPECT_EQ(problem.T_cw.size(), whole.keyframes.size());
    EXPECT_EQ(problem.p_w.size(), whole.points.size());
    std::vector<int> seen(whole.points.size());
    for (const BundleObservation& one : problem.observations) {
      EXPECT_LT(one.pose, problem.T_cw.size());
      ++seen.at(one.point);
    }
    EXPECT_EQ(std::count(seen.begin(), seen.end(), 0), 0);
    return ++collected >= 20 && writer.commits() >= begun + 200;
  }));
}

using Nanoseconds = std::chrono::nanoseconds;

/// CPU time used by the thread with this clock.
Nanoseconds used(clockid_t clock) {
  timespec time{};
  clock_gettime(clock, &time);
  return std::chrono::seconds(time.tv_sec) + Nanoseconds(time.tv_nsec);
}

/// True if a thread of this process sleeps, for example on a lock.
bool sleeps(pid_t thread) {
  std::ifstream stat("/proc/self/task/" + std::to_string(thread) + "/stat");
  const std::string line{std::istreambuf_iterator<char>(stat), {}};
  const std::size_t name_ends = line.rfind(')');
  return name_ends != std::string::npos && line.compare(name_ends, 3, ") S") == 0;
}

/// Blocks a map until it is opened: one thread reads it and another waits to change it.
class ClosedMap {
 public:
  explicit ClosedMap(Map& map)
      : reader_([this, &map] {
          map.read([&](const MapView&) {
            reads_.set_value();
            opened_.get_future().wait();
          });
        }) {
    reads_.get_future().wait();
    writer_ = std::thread([this, &map] {
      commits_ = gettid();
      map.commit({});
    });
    closed_ = BusyWriter::until([&] { return commits_ != 0 && sleeps(commits_); });
  }
  bool closed() const { return closed_; }
  void open() {
    opened_.set_value();
    reader_.join();
    writer_.join();
  }

 private:
  std::promise<void> reads_, opened_;
  std::atomic<pid_t> commits_{0};
  bool closed_ = false;
  std::thread reader_, writer_;
};

TEST(WholeMap, PlacesAreSearchedWhileNobodyGetsAtIt) {
  SyntheticScene scene(2000);
  Map map;
  fill(map);
  PlaceIndex index(scene_vocabulary(scene));
  BagOfWords bag;
  for (std::uint32_t word = 0; word < 100; ++word) bag.words.emplace_back(word, 0.01f);
  for (std::uint64_t n = 1; n <= 20000; ++n) index.add(kf(n), bag);
  const Nanoseconds begin = used(CLOCK_THREAD_CPUTIME_ID);
  const auto expected = index.candidates(bag, map);
  const Nanoseconds whole = used(CLOCK_THREAD_CPUTIME_ID) - begin;

  ClosedMap gate(map);
  ASSERT_TRUE(gate.closed());
  std::atomic<Nanoseconds> begun{Nanoseconds::zero()};
  std::vector<KeyFrameId> found;
  std::thread search([&] {
    begun = used(CLOCK_THREAD_CPUTIME_ID);
    found = index.candidates(bag, map);
  });
  clockid_t clock{};
  pthread_getcpuclockid(search.native_handle(), &clock);
  // Waiting for the map uses no CPU time, searching does.
  EXPECT_TRUE(BusyWriter::until([&] {
    const Nanoseconds start = begun;
    return start > Nanoseconds::zero() && used(clock) - start > whole / 2;
  })) << whole.count()
      << " ns for a search";
  gate.open();
  search.join();
  EXPECT_EQ(found, expected);
}

}  // namespace
}  // namespace slambed::testing
