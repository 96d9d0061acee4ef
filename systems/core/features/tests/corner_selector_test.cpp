// SPDX-License-Identifier: Apache-2.0
#include "features/corner_selector.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <tuple>
#include <utility>
#include <vector>

namespace slambed {
namespace {

DetectionRegion region(int width, int height) {
  return DetectionRegion(GrayView{nullptr, width + 32, height + 32, width + 32});
}

std::vector<Corner> random_corners(int count, int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<std::uint8_t> taken(static_cast<std::size_t>(width) * height, 0);
  for (int i = 0; i < count; ++i) taken[random() % taken.size()] = 7 + random() % 60;
  std::vector<Corner> corners;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      if (const auto response = taken[static_cast<std::size_t>(y) * width + x])
        corners.push_back(
            {static_cast<std::uint16_t>(x + 16), static_cast<std::uint16_t>(y + 16), response});
  return corners;
}

auto place(const Corner& c) { return std::tuple(c.y, c.x, c.response); }

class CornerSelectorTest : public ::testing::TestWithParam<Distribution> {
 protected:
  CornerSelector selector_{GetParam()};
  int overshoot() const { return GetParam() == Distribution::kGrid ? 0 : 3; }
};

TEST_P(CornerSelectorTest, FillsTheQuotaWithSomeOfTheCornersInRasterOrder) {
  for (const int quota : {1, 5, 60, 217, 500}) {
    const auto all = random_corners(3000, 608, 448, 1);
    auto kept = all;
    selector_.select(region(608, 448), quota, kept);
    EXPECT_GE(static_cast<int>(kept.size()), quota);
    EXPECT_LE(static_cast<int>(kept.size()), quota + overshoot());
    std::size_t next = 0;
    for (const Corner& c : all)
      if (next < kept.size() && place(c) == place(kept[next])) ++next;
    EXPECT_EQ(next, kept.size());
  }
}

TEST_P(CornerSelectorTest, KeepsEverythingBelowTheQuota) {
  const auto all = random_corners(50, 100, 80, 2);
  auto kept = all;
  selector_.select(region(100, 80), 60, kept);
  EXPECT_EQ(kept.size(), all.size());
  selector_.select(region(100, 80), 0, kept);
  EXPECT_TRUE(kept.empty());
}

TEST_P(CornerSelectorTest, SpreadsOverTheImageWhenAllStrongCornersAreInOneCorner) {
  auto corners = random_corners(2000, 608, 448, 3);
  for (Corner& c : corners) c.response = c.x < 120 && c.y < 120 ? 200 : 10;
  selector_.select(region(608, 448), 100, corners);
  int far = 0;
  for (const Corner& c : corners) far += c.x > 320;
  EXPECT_GT(far, 35);
}

TEST_P(CornerSelectorTest, TakesTheStrongestOfADenseCluster) {
  std::vector<Corner> corners;
  for (std::uint16_t y = 100; y < 110; ++y)
    for (std::uint16_t x = 100; x < 110; ++x)
      corners.push_back({x, y, static_cast<std::uint8_t>(x == 104 && y == 107 ? 90 : 30)});
  for (std::uint16_t x = 20; x < 600; x += 29) corners.push_back({x, 400, 20});
  selector_.select(region(608, 448), 21, corners);
  bool has_strongest = false;
  for (const Corner& c : corners) has_strongest |= c.x == 104 && c.y == 107;
  EXPECT_TRUE(has_strongest);
}

TEST_P(CornerSelectorTest, EqualResponsesAreDecidedTheSameWayEveryTime) {
  auto once = random_corners(3000, 608, 448, 4);
  for (Corner& c : once) c.response = 30;
  auto again = once;
  selector_.select(region(608, 448), 217, once);
  CornerSelector fresh(GetParam());
  fresh.select(region(608, 448), 217, again);
  ASSERT_EQ(once.size(), again.size());
  for (std::size_t i = 0; i < once.size(); ++i) EXPECT_EQ(place(once[i]), place(again[i]));
}

TEST_P(CornerSelectorTest, WorksOnFlatAndTallRegions) {
  for (const auto& [width, height] : {std::pair(600, 3), std::pair(3, 600), std::pair(1, 1)}) {
    auto corners = random_corners(400, width, height, 5);
    const auto found = corners.size();
    selector_.select(region(width, height), 40, corners);
    EXPECT_GE(corners.size(), std::min<std::size_t>(found, 40));
    EXPECT_LE(static_cast<int>(corners.size()), 40 + overshoot());
  }
}

/// Reference for the grid rule: sorts by rank in the cell, then response, then raster order.
std::vector<Corner> by_the_rule(const DetectionRegion& r, int quota,
                                const std::vector<Corner>& corners) {
  const double side = std::sqrt(static_cast<double>(r.width()) * r.height() / quota);
  const int columns = std::max(1, static_cast<int>(std::lround(r.width() / side)));
  const int rows = std::max(1, static_cast<int>(std::lround(r.height() / side)));
  std::map<std::pair<int, int>, std::vector<std::pair<int, std::size_t>>> cells;
  for (std::size_t i = 0; i < corners.size(); ++i)
    cells[{(corners[i].y - r.y0) * rows / r.height(), (corners[i].x - r.x0) * columns / r.width()}]
        .emplace_back(-corners[i].response, i);
  std::vector<std::tuple<std::size_t, int, std::size_t>> order;
  for (auto& [place, members] : cells) {
    std::sort(members.begin(), members.end());
    for (std::size_t rank = 0; rank < members.size(); ++rank)
      order.emplace_back(rank, members[rank].first, members[rank].second);
  }
  std::sort(order.begin(), order.end());
  std::vector<std::size_t> chosen;
  for (int i = 0; i < quota; ++i) chosen.push_back(std::get<2>(order[i]));
  std::sort(chosen.begin(), chosen.end());
  std::vector<Corner> kept;
  for (const std::size_t i : chosen) kept.push_back(corners[i]);
  return kept;
}

TEST(CornerSelector, TheGridTakesRoundsOfTheBestOfEachCell) {
  CornerSelector selector(Distribution::kGrid);
  for (const int width : {608, 150, 20})  // corners in a few or in all of the cells
    for (const int quota : {1, 60, 217}) {
      const auto all = random_corners(900, width, 100, 6);
      ASSERT_GT(static_cast<int>(all.size()), quota);
      auto kept = all;
      selector.select(region(608, 448), quota, kept);
      const auto expected = by_the_rule(region(608, 448), quota, all);
      ASSERT_EQ(kept.size(), expected.size());
      for (std::size_t i = 0; i < kept.size(); ++i) EXPECT_EQ(place(kept[i]), place(expected[i]));
    }
}

INSTANTIATE_TEST_SUITE_P(Both, CornerSelectorTest,
                         ::testing::Values(Distribution::kGrid, Distribution::kQuadtree),
                         [](const auto& p) {
                           return p.param == Distribution::kGrid ? "Grid" : "Quadtree";
                         });

}  // namespace
}  // namespace slambed
