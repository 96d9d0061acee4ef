// SPDX-License-Identifier: Apache-2.0
// Tests how well a mask culls later frames, against the generator's true masks.
#include "edgeslam_semantic/culling_by_age.hpp"

#include <gtest/gtest.h>

#include "base/tests/temporary_folder.hpp"
#include "sequence/feature_source.hpp"
#include "sequence/mask_cache.hpp"
#include "synth/generator.hpp"
#include "wire/hello.hpp"

namespace slambed::edgeslam_semantic {
namespace {

constexpr int kAcross = 320, kDown = 240, kSeconds = 3, kRate = 15, kAges = 20;

/// Plays two people who cross the picture in front of a moving camera.
class Culling : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder = std::make_unique<testing::TemporaryFolder>();
    synth::GeneratorOptions options;
    options.sensor = "mono";
    options.trajectory = "xyz";
    options.people = 2;
    options.activity = "crossing";
    options.labels = true;
    options.width = kAcross;
    options.height = kDown;
    options.fps = kRate;
    options.seconds = kSeconds;
    synth::generate(options, folder->path() / "walk", 2, [](int, int) { return true; });
  }
  static void TearDownTestSuite() { folder.reset(); }

  Culling()
      : pictures(folder->path() / "walk"),
        extracted(pictures, wire::SensorInfo{.camera = pictures.camera()}.make_sensor(),
                  OrbOptions{.features = 600}),
        labels(kAcross, kDown) {
    labels.add(0, folder->path() / "walk" / "labels.bin", "labels", pictures.frames());
    sequence = {.frames = pictures.frames(),
                .fps = kRate,
                .features = [this](std::uint64_t i) { return extracted.features(i); },
                .masks = [this](std::uint64_t i) { return truth(i); },
                .truth = [this](std::uint64_t i) { return truth(i); }};
  }
  FrameMasks truth(std::uint64_t i) { return labels.masks(i, {}, 0).masks.value(); }

  static inline std::unique_ptr<testing::TemporaryFolder> folder;
  PreparedSequence pictures;
  ExtractingSource extracted;
  MaskCache labels;
  CullingSequence sequence;
};

TEST_F(Culling, TrueMasksCullEverybodyAtOnceAndFewerAsTheyAge) {
  const auto ages = culling_by_age(sequence, {.oldest = kAges});
  ASSERT_EQ(ages.size(), std::size_t{kAges} + 1);
  ASSERT_GT(ages[0].on_movers, 100);
  EXPECT_EQ(ages[0].recall(), 1);
  EXPECT_EQ(ages[0].precision(), 1);
  EXPECT_LT(ages[kAges].recall(), ages[1].recall());
  EXPECT_GT(ages[1].recall(), 0.8);
  EXPECT_GT(ages[7].recall(), 0.6);
  EXPECT_GT(ages[1].precision(), 0.8);
}

TEST_F(Culling, AMaskThatIsLateCullsAsOneThatCameAtOnce) {
  const auto at_once = culling_by_age(sequence, {.oldest = kAges});
  const auto late = culling_by_age(sequence, {.oldest = kAges, .late = 7});
  EXPECT_EQ(late[6].culled, 0);
  for (std::size_t age = 7; age <= kAges; ++age) {
    EXPECT_EQ(late[age].culled, at_once[age].culled) << age;
    EXPECT_EQ(late[age].found, at_once[age].found) << age;
  }
}

TEST_F(Culling, WithoutMasksNobodyIsCulled) {
  sequence.masks = [](std::uint64_t) { return FrameMasks{kAcross, kDown, {}}; };
  for (const CullingCounts& age : culling_by_age(sequence, {.oldest = 3})) {
    EXPECT_EQ(age.culled, 0);
    EXPECT_EQ(age.recall(), 0);
  }
}

TEST_F(Culling, LabelsThatEndCullNobody) {
  CullingOptions options{.oldest = 10};
  options.labels.frames = 5;
  const auto ages = culling_by_age(sequence, options);
  EXPECT_GT(ages[5].culled, 0);
  EXPECT_EQ(ages[6].culled, 0);
}

}  // namespace
}  // namespace slambed::edgeslam_semantic
