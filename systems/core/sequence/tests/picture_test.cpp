// SPDX-License-Identifier: Apache-2.0
// Images sent to the edge, and the features that the edge extracts from them.
#include <gtest/gtest.h>

#include <algorithm>

#include "base/tests/temporary_folder.hpp"
#include "sequence/feature_cache.hpp"
#include "sequence/picture_features.hpp"
#include "synth/generator.hpp"
#include "wire/hello.hpp"

namespace slambed {
namespace {

class PictureTest : public ::testing::Test {
 protected:
  PictureTest() {
    synth::GeneratorOptions options;
    options.sensor = "mono";
    options.width = 320;
    options.height = 240;
    options.fps = 5;
    options.seconds = 0.6;
    synth::generate(options, folder.path() / "sequence", 1, [](int, int) { return true; });
    sequence.emplace(folder.path() / "sequence");
    sensor = wire::SensorInfo{.camera = sequence->camera()}.make_sensor();
  }

  testing::TemporaryFolder folder;
  std::optional<PreparedSequence> sequence;
  std::shared_ptr<const Sensor> sensor;
  OrbOptions orb{.features = 500};
};

TEST_F(PictureTest, TheCacheGivesTheBytesThatCodingGives) {
  EncodingSource fresh(*sequence, 90);
  ImageCache cache(folder.path() / "x.images", "key", *sequence, 90);
  for (std::uint64_t frame = 0; frame < sequence->frames(); ++frame) {
    ASSERT_GT(fresh.jpeg(frame).size(), 1000u);
    EXPECT_EQ(cache.jpeg(frame), fresh.jpeg(frame));
  }
  EXPECT_LT(EncodingSource(*sequence, 20).jpeg(0).size(), fresh.jpeg(0).size());
}

TEST_F(PictureTest, VirtualFeaturesAreThoseOfThePictureThatCame) {
  EncodingSource images(*sequence, 90);
  JpegFeatureSource source(images, sensor, orb);
  FeatureCache cache(folder.path() / "x.features", "key", sequence->frames(), source);
  KnownPictures known(cache);
  DecodedPictures decoded([this] { return sensor; }, orb);
  ExtractingSource clean(*sequence, sensor, orb);
  for (std::uint64_t frame = 0; frame < sequence->frames(); ++frame) {
    const wire::Bytes jpeg = images.jpeg(frame);
    known.decode(jpeg);
    decoded.decode(jpeg);
    const auto a = known.extract(frame), b = decoded.extract(frame);
    ASSERT_GT(a->size(), 300);
    EXPECT_TRUE(std::ranges::equal(a->descriptors(), b->descriptors()));
    // They differ from the features of the image before compression.
    EXPECT_FALSE(std::ranges::equal(a->descriptors(), clean.features(frame)->descriptors()));
  }
}

TEST_F(PictureTest, ATornPictureAndAnUnknownCameraAreRefused) {
  const wire::Bytes jpeg = EncodingSource(*sequence, 90).jpeg(0);
  const auto torn = std::span(jpeg).first(jpeg.size() - 5);
  DecodedPictures decoded([this] { return sensor; }, orb);
  EXPECT_THROW(decoded.decode(torn), wire::DecodeError);
  ExtractingSource clean(*sequence, sensor, orb);
  EXPECT_THROW(KnownPictures(clean).decode(torn), wire::DecodeError);
  DecodedPictures stranger([] { return nullptr; }, orb);
  EXPECT_THROW(stranger.decode(jpeg), wire::DecodeError);
}

}  // namespace
}  // namespace slambed
