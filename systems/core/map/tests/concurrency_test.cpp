// SPDX-License-Identifier: Apache-2.0
// Readers always see whole commits of a concurrent writer. Also run with the thread sanitizer.
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <functional>
#include <thread>

#include "map_fixture.hpp"

namespace slambed::testing {
namespace {

TEST(Concurrency, ReadersSeeWholeCommitsOnly) {
  Map map;
  std::atomic<bool> done{false};
  std::atomic<int> broken{0};
  constexpr std::uint64_t kCommits = 60;
  std::array<std::atomic<std::uint64_t>, 2> seen{};  ///< last revision that each reader saw
  const auto reader = [&](std::atomic<std::uint64_t>& mine) {
    std::uint64_t last = 0;
    while (!done) {
      const std::uint64_t hint = map.revision();
      map.read([&](const MapView& view) {
        broken += view.revision() < hint || view.revision() < last;
        last = view.revision();
        // Each commit adds one keyframe and ten points, and moves all points to its number.
        broken += view.point_count() != 10 * view.keyframe_count();
        const auto at = static_cast<double>(view.keyframe_count());
        for (const MapPointId id : view.point_ids()) broken += view.point(id)->p_w.x() != at;
        return 0;
      });
      mine = last;
    }
  };
  std::thread a(reader, std::ref(seen[0])), b(reader, std::ref(seen[1]));
  for (std::uint64_t n = 1; n <= kCommits; ++n) {
    MapDelta delta;
    const auto number = static_cast<double>(n);
    for (std::uint64_t p = 10 * n - 9; p <= 10 * n; ++p)
      delta.points.push_back(new_point(p, {number, 0, 2}));
    delta.keyframes = {new_keyframe(n, points_from(10 * n - 9, 10))};
    for (std::uint64_t p = 1; p <= 10 * n - 10; ++p)
      delta.positions.push_back({pt(p), {number, 0, 2}, static_cast<std::uint32_t>(n)});
    map.commit(delta);
    // The writer sometimes waits for both readers, so that it cannot finish before they read.
    if (n % 10 != 0) continue;
    while (seen[0] < map.revision() || seen[1] < map.revision()) std::this_thread::yield();
  }
  done = true;
  a.join();
  b.join();
  EXPECT_EQ(broken, 0);
}

}  // namespace
}  // namespace slambed::testing
