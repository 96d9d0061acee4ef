// SPDX-License-Identifier: Apache-2.0
// Matching inside the nodes of a vocabulary.
#include "slam/word_matching.hpp"

#include <gtest/gtest.h>

#include "scene_vocabulary.hpp"

namespace slambed::testing {
namespace {

struct Image {
  std::shared_ptr<const FeatureSet> features;
  std::vector<int> things;
  BagOfWords bag;
};

class WordMatching : public ::testing::Test {
 protected:
  WordMatching() : vocabulary(scene_vocabulary(scene)) {
    a = look(walk(0), 0);
    b = look(walk(20), 8);
  }
  Image look(const SE3& T_cw, int flipped_bits) {
    Image image;
    image.features = scene.look(T_cw, {.flipped_bits = flipped_bits});
    image.things = scene.seen();
    image.bag = vocabulary->transform(image.features->descriptors());
    return image;
  }

  SyntheticScene scene{3000};
  std::shared_ptr<const Vocabulary> vocabulary;
  Image a, b;
};

TEST_F(WordMatching, MatchesAreRightAndOneToOne) {
  int common = 0;
  for (const int thing : a.things)
    common += std::count(b.things.begin(), b.things.end(), thing) > 0;
  const auto matches = match_by_words({*a.features, a.bag, {}}, {*b.features, b.bag, {}}, 0.75f);
  EXPECT_GT(static_cast<int>(matches.size()), common / 2);
  std::vector<int> used;
  for (const auto& [i, j] : matches) {
    EXPECT_EQ(a.things[i], b.things[j]);
    used.push_back(i);
  }
  std::sort(used.begin(), used.end());
  EXPECT_EQ(std::adjacent_find(used.begin(), used.end()), used.end());
}

TEST_F(WordMatching, OnlyWantedFeaturesTakePart) {
  std::vector<std::uint8_t> even(a.things.size()), none(b.things.size());
  for (std::size_t i = 0; i < even.size(); i += 2) even[i] = 1;
  for (const auto& [i, j] :
       match_by_words({*a.features, a.bag, even}, {*b.features, b.bag, {}}, 0.75f))
    EXPECT_EQ(i % 2, 0);
  EXPECT_TRUE(match_by_words({*a.features, a.bag, {}}, {*b.features, b.bag, none}, 0.75f).empty());
}

TEST_F(WordMatching, EmptyImagesHaveNoMatches) {
  const auto nothing = scene.nothing();
  const BagOfWords empty = vocabulary->transform(nothing->descriptors());
  EXPECT_TRUE(match_by_words({*nothing, empty, {}}, {*b.features, b.bag, {}}, 0.75f).empty());
  EXPECT_TRUE(match_by_words({*b.features, b.bag, {}}, {*nothing, empty, {}}, 0.75f).empty());
}

}  // namespace
}  // namespace slambed::testing
