// SPDX-License-Identifier: Apache-2.0
// The vocabulary tree: training, words, weights, similarity, valid and damaged files.
#include "features/vocabulary.hpp"

#include <gtest/gtest.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <fstream>
#include <random>
#include <string>

#include "base/error.hpp"
#include "features/default_vocabulary.hpp"

namespace slambed {
namespace {

namespace fs = std::filesystem;

Descriptor random_descriptor(std::mt19937_64& random) {
  return {random(), random(), random(), random()};
}

Descriptor flip_bits(Descriptor d, int bits, std::mt19937_64& random) {
  for (int i = 0; i < bits; ++i) {
    const auto bit = random() % 256;
    d[bit / 64] ^= std::uint64_t{1} << (bit % 64);
  }
  return d;
}

/// Places with landmarks. An image of a place has its landmarks' descriptors with few bits flipped.
struct Scene {
  explicit Scene(int places, int per_place = 80) {
    for (int p = 0; p < places; ++p) {
      landmarks.emplace_back();
      for (int i = 0; i < per_place; ++i) landmarks.back().push_back(random_descriptor(random));
    }
  }
  std::vector<Descriptor> image(int place, int bits = 12) {
    std::vector<Descriptor> seen;
    for (const Descriptor& d : landmarks[place]) seen.push_back(flip_bits(d, bits, random));
    return seen;
  }
  std::mt19937_64 random{5};
  std::vector<std::vector<Descriptor>> landmarks;
};

Vocabulary trained(Scene& scene, int depth = 3) {
  std::vector<std::vector<Descriptor>> images;
  for (std::size_t p = 0; p < scene.landmarks.size(); ++p) {
    for (int i = 0; i < 3; ++i) images.push_back(scene.image(static_cast<int>(p)));
  }
  return Vocabulary::train(images, {.branching = 10, .depth = depth});
}

class VocabularyFile : public ::testing::Test {
 protected:
  VocabularyFile()
      : folder_(fs::temp_directory_path() / ("slambed_voc_" + std::to_string(::getpid()))) {
    fs::create_directories(folder_);
  }
  ~VocabularyFile() override { fs::remove_all(folder_); }
  fs::path folder_;
};

TEST(Vocabulary, ASecondLookAtAPlaceIsMoreSimilarThanAnyOtherPlace) {
  Scene scene(30);
  const Vocabulary vocabulary = trained(scene);
  std::vector<BagOfWords> first, second;
  for (int p = 0; p < 30; ++p) {
    first.push_back(vocabulary.transform(scene.image(p)));
    second.push_back(vocabulary.transform(scene.image(p)));
  }
  for (int p = 0; p < 30; ++p) {
    const double same = similarity(first[p], second[p]);
    for (int q = 0; q < 30; ++q) {
      if (q == p) continue;
      EXPECT_GT(same, 2 * similarity(first[p], second[q])) << p << " against " << q;
    }
  }
}

TEST(Vocabulary, BagsAreNormalizedOrderedAndCompleteAndSimilarityIsBounded) {
  Scene scene(10);
  const Vocabulary vocabulary = trained(scene);
  const BagOfWords bag = vocabulary.transform(scene.image(4));
  double sum = 0;
  for (const auto& word : bag.words) sum += word.second;
  EXPECT_NEAR(sum, 1, 1e-5);
  EXPECT_TRUE(std::is_sorted(bag.words.begin(), bag.words.end()));
  std::size_t features = 0;
  for (const auto& node : bag.nodes) features += node.second.size();
  EXPECT_EQ(features, 80u);
  EXPECT_NEAR(similarity(bag, bag), 1, 1e-5);
  EXPECT_EQ(similarity(bag, {}), 0);
}

TEST(Vocabulary, NoFeaturesGiveAnEmptyBag) {
  Scene scene(4);
  const BagOfWords bag = trained(scene).transform({});
  EXPECT_TRUE(bag.words.empty());
  EXPECT_TRUE(bag.nodes.empty());
}

TEST(Vocabulary, EqualSeedsTrainEqualTrees) {
  Scene a(10), b(10);
  Scene query(10);
  const auto image = query.image(3);
  EXPECT_EQ(trained(a).transform(image).words, trained(b).transform(image).words);
}

TEST(Vocabulary, TrainingRefusesNothingAndNonsense) {
  EXPECT_THROW(Vocabulary::train({}), Error);
  Scene scene(1);
  const std::vector<std::vector<Descriptor>> images{scene.image(0)};
  EXPECT_THROW(Vocabulary::train(images, {.branching = 1}), Error);
  EXPECT_THROW(Vocabulary::train(images, {.depth = 0}), Error);
}

TEST_F(VocabularyFile, RoundTripKeepsEveryAnswer) {
  Scene scene(10);
  const Vocabulary before = trained(scene);
  before.save(folder_ / "v.slv");
  const Vocabulary after = Vocabulary::load(folder_ / "v.slv");
  EXPECT_EQ(after.words(), before.words());
  const auto image = scene.image(2);
  EXPECT_EQ(after.transform(image).words, before.transform(image).words);
  EXPECT_EQ(after.transform(image).nodes, before.transform(image).nodes);
}

TEST_F(VocabularyFile, EveryFlippedByteAndEveryCutIsNoticed) {
  Scene scene(3, 20);
  trained(scene, 2).save(folder_ / "v.slv");
  std::ifstream in(folder_ / "v.slv", std::ios::binary);
  const std::string good((std::istreambuf_iterator<char>(in)), {});
  const auto write = [&](const std::string& bytes) {
    std::ofstream(folder_ / "bad.slv", std::ios::binary) << bytes;
  };
  for (std::size_t i = 0; i < good.size(); i += i < 24 ? 1 : 37) {
    if (i == 10 || i == 11) continue;  // reserved bytes of the header are ignored
    std::string bad = good;
    bad[i] = static_cast<char>(bad[i] ^ 0x41);
    write(bad);
    if (i >= 6 && i < 10) continue;  // branching and depth are not checked against the tree
    EXPECT_THROW(Vocabulary::load(folder_ / "bad.slv"), Error) << "byte " << i;
  }
  for (const std::size_t cut :
       {std::size_t{0}, std::size_t{10}, std::size_t{24}, good.size() - 1}) {
    write(good.substr(0, cut));
    EXPECT_THROW(Vocabulary::load(folder_ / "bad.slv"), Error) << "cut at " << cut;
  }
  EXPECT_THROW(Vocabulary::load(folder_ / "absent.slv"), Error);
}

TEST_F(VocabularyFile, DamageUnderARightChecksumIsRefusedOrHarmless) {
  Scene scene(3, 20);
  trained(scene, 2).save(folder_ / "v.slv");
  std::ifstream in(folder_ / "v.slv", std::ios::binary);
  const std::vector<std::uint8_t> good((std::istreambuf_iterator<char>(in)), {});
  ASSERT_NO_THROW(Vocabulary::parse(good, "good"));
  constexpr std::size_t kHeader = 24, kRecord = 48, kLinks = 32;
  const auto image = scene.image(1);
  std::mt19937 random(6);
  int refused = 0;
  constexpr int kTries = 4000;
  for (int i = 0; i < kTries; ++i) {
    auto bad = good;
    for (std::uint32_t n = 1 + random() % 3; n > 0; --n) {
      // Mostly damage links and levels, which a reader follows.
      const std::size_t record = kHeader + random() % ((bad.size() - kHeader) / kRecord) * kRecord;
      const bool header = random() % 8 == 0;
      bad[header ? 4 + random() % 16 : record + kLinks + random() % 16] =
          static_cast<std::uint8_t>(random());
    }
    const auto crc =
        static_cast<std::uint32_t>(::crc32_z(0, bad.data() + kHeader, bad.size() - kHeader));
    for (int b = 0; b < 4; ++b) bad[20 + b] = static_cast<std::uint8_t>(crc >> (8 * b));
    try {
      // An accepted vocabulary must be usable.
      const BagOfWords bag = Vocabulary::parse(bad, "bad").transform(image);
      EXPECT_LE(similarity(bag, bag), 1 + 1e-6);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ExitCode::kBadInput);
      ++refused;
    }
  }
  EXPECT_GT(refused, kTries / 4);
  EXPECT_LT(refused, kTries);
}

TEST(DefaultVocabulary, IsBuiltInAndTellsPlacesApart) {
  const auto vocabulary = default_vocabulary();
  EXPECT_EQ(vocabulary->words(), 10000u);
  EXPECT_EQ(vocabulary->depth(), 4);
  Scene scene(5, 300);
  const BagOfWords here = vocabulary->transform(scene.image(0));
  EXPECT_GT(similarity(here, vocabulary->transform(scene.image(0))),
            2 * similarity(here, vocabulary->transform(scene.image(1))));
}

TEST_F(VocabularyFile, ReadsDbow2Text) {
  // The root has two children, the first of which has two leaves.
  const auto line = [](int parent, bool leaf, int byte, const char* weight) {
    std::string text = std::to_string(parent) + (leaf ? " 1" : " 0");
    for (int i = 0; i < 32; ++i) text.append(" ").append(std::to_string(byte));
    return text + " " + weight + "\n";
  };
  std::ofstream(folder_ / "orb.txt") << "2 2 0 0\n"
                                     << line(0, false, 0, "0") << line(0, true, 255, "1.5")
                                     << line(1, true, 1, "2") << line(1, true, 15, "0.5");
  const Vocabulary vocabulary = Vocabulary::load_dbow2_text(folder_ / "orb.txt");
  EXPECT_EQ(vocabulary.words(), 3u);
  const Descriptor low{0x0101010101010101u, 0x0101010101010101u, 0x0101010101010101u,
                       0x0101010101010101u};
  const Descriptor high{~std::uint64_t{0}, ~std::uint64_t{0}, ~std::uint64_t{0}, ~std::uint64_t{0}};
  const BagOfWords bag = vocabulary.transform(std::vector<Descriptor>{low, high});
  ASSERT_EQ(bag.words.size(), 2u);
  EXPECT_NEAR(std::max(bag.words[0].second, bag.words[1].second), 2 / 3.5, 1e-6);

  std::ofstream(folder_ / "bad.txt") << "2 2 0 0\n" << line(7, true, 1, "1");
  EXPECT_THROW(Vocabulary::load_dbow2_text(folder_ / "bad.txt"), Error);
  std::ofstream(folder_ / "worse.txt") << "hello\n";
  EXPECT_THROW(Vocabulary::load_dbow2_text(folder_ / "worse.txt"), Error);
}

}  // namespace
}  // namespace slambed
