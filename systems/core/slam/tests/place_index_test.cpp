// SPDX-License-Identifier: Apache-2.0
// Which keyframes look like an image: words in common, similarity, groups of covisibles.
#include "slam/place_index.hpp"

#include <gtest/gtest.h>

#include "synthetic_world.hpp"
#include "world_vocabulary.hpp"

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
  PlaceIndexTest() : index(world_vocabulary(world)) {
    MapDelta delta;
    const auto features = world.look(SE3(), {}, 60);
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
    return map.read(
        [&](const MapView& view) { return index.candidates(bag, view, exclude, min_score); });
  }

  SyntheticWorld world{2000};
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
  index.follow(map);
  EXPECT_EQ(index.size(), 4u);
  EXPECT_FALSE(index.bag(keyframe_id(77)));
  const auto bag = index.bag(keyframe_id(3));
  ASSERT_TRUE(bag);
  MapDelta cull;
  cull.culled_keyframes = {keyframe_id(3)};
  map.commit(cull);
  index.follow(map);
  EXPECT_EQ(index.size(), 3u);
  EXPECT_EQ(ask(*bag).size(), 2u);  // of equal groups each
}

TEST_F(PlaceIndexTest, AnEmptyIndexOrBagHasNoAnswer) {
  EXPECT_TRUE(ask(bag_of({1})).empty());
  index.follow(map);
  EXPECT_TRUE(ask({}).empty());
}

}  // namespace
}  // namespace slambed::testing
