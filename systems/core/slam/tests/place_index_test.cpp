// SPDX-License-Identifier: Apache-2.0
// Place recognition: common words, similarity, groups of covisibles.
#include "slam/place_index.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

#include "scene_vocabulary.hpp"
#include "synthetic_scene.hpp"

namespace slambed::testing {
namespace {

KeyFrameId keyframe_id(std::uint64_t i) { return {std::uint64_t{1} << 56 | i}; }

BagOfWords bag_of(std::initializer_list<std::uint32_t> words) {
  BagOfWords bag;
  for (const std::uint32_t word : words)
    bag.words.emplace_back(word, 1.0f / static_cast<float>(words.size()));
  return bag;
}

/// Keyframes 1 to 4 in pairs (1, 2), (3, 4) that share points.
class PlaceIndexTest : public ::testing::Test {
 protected:
  PlaceIndexTest() : index(scene_vocabulary(scene)) {
    MapDelta delta;
    const auto features = scene.look(SE3(), {}, 60);
    for (std::uint64_t k = 1; k <= 4; ++k) {
      NewKeyFrame keyframe;
      keyframe.id = keyframe_id(k);
      keyframe.features = features;
      for (int i = 0; i < features->size(); ++i)
        keyframe.points.push_back({std::uint64_t{1} << 56 | (100 * ((k + 1) / 2) + i)});
      delta.keyframes.push_back(keyframe);
    }
    for (std::uint64_t place : {1, 2})
      for (int i = 0; i < features->size(); ++i) {
        NewPoint point;
        point.id = {std::uint64_t{1} << 56 | (100 * place + i)};
        point.reference = point.first_keyframe = keyframe_id(2 * place - 1);
        delta.points.push_back(point);
      }
    map.commit(delta);
  }
  std::vector<KeyFrameId> ask(const BagOfWords& bag, std::vector<KeyFrameId> exclude = {},
                              double min_score = 0) {
    return index.candidates(bag, map, exclude, min_score);
  }

  SyntheticScene scene{2000};
  Map map;
  PlaceIndex index;
};

TEST_F(PlaceIndexTest, TheBestOfTheBestGroupComesFirst) {
  index.add(keyframe_id(1), bag_of({1, 2, 3, 4, 50, 51, 52, 53}));
  index.add(keyframe_id(2), bag_of({1, 2, 3, 4}));
  index.add(keyframe_id(3), bag_of({1, 2, 3, 4, 60, 61}));
  const auto found = ask(bag_of({1, 2, 3, 4}));
  ASSERT_FALSE(found.empty());
  // 1 and 2 count together (1.5), 3 alone gives 0.67, which is less than three quarters of that.
  EXPECT_EQ(found, std::vector<KeyFrameId>{keyframe_id(2)});
}

TEST_F(PlaceIndexTest, FewCommonWordsAreNotEnough) {
  index.add(keyframe_id(1), bag_of({1, 2, 3, 4, 5}));
  index.add(keyframe_id(3), bag_of({1, 2, 3, 4, 50}));  // 4 of 5 is not more than 80 %
  index.add(keyframe_id(4), bag_of({70, 71}));
  EXPECT_EQ(ask(bag_of({1, 2, 3, 4, 5})), std::vector<KeyFrameId>{keyframe_id(1)});
}

TEST_F(PlaceIndexTest, ExcludedAndDissimilarOnesAreLeftOut) {
  index.add(keyframe_id(1), bag_of({1, 2, 3, 4}));
  index.add(keyframe_id(3), bag_of({1, 2, 3, 4, 5}));
  EXPECT_EQ(ask(bag_of({1, 2, 3, 4}), {keyframe_id(1)}), std::vector<KeyFrameId>{keyframe_id(3)});
  EXPECT_TRUE(ask(bag_of({1, 2, 3, 4}), {keyframe_id(1)}, 0.9).empty());
}

TEST_F(PlaceIndexTest, RemovedAndReplacedKeyFramesLeaveNothingBehind) {
  index.add(keyframe_id(1), bag_of({1, 2, 3}));
  index.add(keyframe_id(1), bag_of({7, 8, 9}));
  EXPECT_EQ(index.size(), 1u);
  EXPECT_TRUE(ask(bag_of({1, 2, 3})).empty());
  EXPECT_EQ(ask(bag_of({7, 8})).size(), 1u);
  index.remove(keyframe_id(1));
  index.remove(keyframe_id(1));
  EXPECT_EQ(index.size(), 0u);
  EXPECT_FALSE(index.bag(keyframe_id(1)));
  EXPECT_TRUE(ask(bag_of({7, 8, 9})).empty());
  index.add(keyframe_id(2), bag_of({1, 2}));
  index.clear();
  EXPECT_TRUE(ask(bag_of({1, 2})).empty());
}

TEST_F(PlaceIndexTest, FollowsAMap) {
  index.add(keyframe_id(77), bag_of({1, 2}));
  index.update_from(map);
  EXPECT_EQ(index.size(), 4u);
  EXPECT_FALSE(index.bag(keyframe_id(77)));
  const auto bag = index.bag(keyframe_id(3));
  ASSERT_TRUE(bag);
  MapDelta cull;
  cull.culled_keyframes = {keyframe_id(3)};
  map.commit(cull);
  index.update_from(map);
  EXPECT_EQ(index.size(), 3u);
  EXPECT_EQ(ask(*bag).size(), 2u);  // one per group, both groups being equal
}

TEST_F(PlaceIndexTest, FollowsAMapThatBeginsAnewAndAnotherMap) {
  index.update_from(map);
  MapDelta other;
  for (std::uint64_t k : {5, 6}) {
    NewKeyFrame keyframe;
    keyframe.id = keyframe_id(k);
    keyframe.features = scene.look(SE3(), {}, 60);
    keyframe.points.resize(keyframe.features->size());
    other.keyframes.push_back(keyframe);
  }
  map.clear();
  map.commit(other);
  index.update_from(map);
  EXPECT_EQ(index.size(), 2u);
  EXPECT_TRUE(index.bag(keyframe_id(5)));
  EXPECT_FALSE(index.bag(keyframe_id(1)));
  Map another;
  other.keyframes.front().id = keyframe_id(7);
  another.commit(other);
  index.update_from(another);
  EXPECT_EQ(index.size(), 2u);
  EXPECT_TRUE(index.bag(keyframe_id(7)));
  EXPECT_FALSE(index.bag(keyframe_id(5)));
}

TEST_F(PlaceIndexTest, ComparesAsIfEveryBagWereComparedOneByOne) {
  std::mt19937_64 random(3);
  const auto random_bag = [&] {
    std::set<std::uint32_t> words;
    while (words.size() < 30) words.insert(static_cast<std::uint32_t>(random() % 100));
    BagOfWords bag;
    for (const std::uint32_t word : words)
      bag.words.emplace_back(word, static_cast<float>(1 + random() % 9) / 150);
    return bag;
  };
  // No keyframe shares a point with another, so each is a group of its own.
  std::map<KeyFrameId, BagOfWords> all;
  MapDelta lonely;
  for (std::uint64_t k = 11; k <= 60; ++k) {
    NewKeyFrame keyframe;
    keyframe.id = keyframe_id(k);
    keyframe.features = scene.look(SE3(), {}, 1);
    keyframe.points.resize(1);
    lonely.keyframes.push_back(keyframe);
  }
  map.commit(lonely);
  for (int round = 0; round < 300; ++round) {
    const KeyFrameId changed = keyframe_id(11 + random() % 50);
    if (all.contains(changed) && random() % 3 == 0) {
      index.remove(changed);
      all.erase(changed);
    } else {
      all[changed] = random_bag();
      index.add(changed, all[changed]);
    }
    const BagOfWords asked = random_bag();
    const std::vector<KeyFrameId> exclude = {keyframe_id(20), keyframe_id(30)};
    const double least = 0.001 * static_cast<double>(random() % 400);
    std::map<KeyFrameId, int> common;
    int most = 0;
    for (const auto& [id, bag] : all) {
      if (std::find(exclude.begin(), exclude.end(), id) != exclude.end()) continue;
      for (const auto& [word, weight] : asked.words)
        common[id] += std::any_of(bag.words.begin(), bag.words.end(),
                                  [&](const auto& other) { return other.first == word; });
      most = std::max(most, common[id]);
    }
    std::vector<std::pair<double, KeyFrameId>> expected;
    for (const auto& [id, words] : common)
      if (const double score = similarity(asked, all[id]); words > 0.8 * most && score >= least)
        expected.emplace_back(-score, id);
    std::sort(expected.begin(), expected.end());
    const auto found = ask(asked, exclude, least);
    std::size_t held = 0;
    while (held < expected.size() && (held == 0 || expected[held].first < 0.75 * expected[0].first))
      ++held;
    ASSERT_EQ(found.size(), held) << "round " << round;
    for (std::size_t i = 0; i < held; ++i) ASSERT_EQ(found[i], expected[i].second) << round;
  }
}

TEST_F(PlaceIndexTest, AnEmptyIndexOrBagHasNoAnswer) {
  EXPECT_TRUE(ask(bag_of({1})).empty());
  index.update_from(map);
  EXPECT_TRUE(ask({}).empty());
}

}  // namespace
}  // namespace slambed::testing
