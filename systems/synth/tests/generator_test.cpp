// SPDX-License-Identifier: Apache-2.0
#include "synth/generator.hpp"

#include <gtest/gtest.h>

#include "synth/sha256.hpp"
#include "synth/tests/sequence_folder.hpp"

namespace slambed::synth {
namespace {

class Generator : public SequenceFolder {
 protected:
  static GeneratorOptions lively() {
    GeneratorOptions options = small();
    options.moving_objects = 1;
    options.sensor_model = {
        .motion_blur_s = 0.01, .noise = 2, .depth_noise = 1, .depth_holes = 0.05};
    return options;
  }

  std::string checksum(const GeneratorOptions& options, const std::string& name, int threads) {
    return make(options, name, threads).at("checksum");
  }
};

TEST_F(Generator, BytesDoNotDependOnThreads) {
  const std::string one = checksum(lively(), "one", 1), three = checksum(lively(), "three", 3);
  EXPECT_EQ(one, three);
  for (const char* file : {"frames.bin", "index.bin", "groundtruth.txt", "sequence.json"})
    EXPECT_EQ(slurp(folder_ / "one" / file), slurp(folder_ / "three" / file)) << file;
  EXPECT_EQ(fs::file_size(folder_ / "one" / "frames.bin"), 5u * 61440u);  // 57,600 padded
}

TEST_F(Generator, SeedAndOptionsChangeTheBytes) {
  const std::string base = checksum(lively(), "base", 2);
  GeneratorOptions other = lively();
  other.seed = 2;
  EXPECT_NE(checksum(other, "seed", 2), base);
  other = lively();
  other.sensor_model.noise = 3;
  EXPECT_NE(checksum(other, "noise", 2), base);
}

// Every machine must give the same bytes. For an intended change of the generator, raise
// kGeneratorVersion and update the checksums.
TEST_F(Generator, BytesAreTheKnownOnes) {
  EXPECT_STREQ(kGeneratorVersion, "2");
  EXPECT_EQ(checksum(lively(), "rgbd", 2),
            "33b89c2a7c36a20bb34c66a23a7cd080f007b1d5a1e3848d3a0bcb7d73ca6ece");
  GeneratorOptions stereo = lively();
  stereo.sensor = "stereo";
  stereo.trajectory = "two_laps";
  EXPECT_EQ(checksum(stereo, "stereo", 2),
            "d7132e4d4b10b6be7526dd4b483fb076bde4455bddb0100d469fb6956b056095");
}

TEST_F(Generator, MonoIsTheLeftPictureOfStereo) {
  GeneratorOptions options = lively();
  options.sensor = "stereo";
  make(options, "stereo", 2);
  options.sensor = "mono";
  const auto header = make(options, "mono", 2);
  constexpr std::size_t kPixels = 160 * 120, kStereoStride = 40960, kMonoStride = 20480;
  const std::string stereo = slurp(folder_ / "stereo" / "frames.bin");
  const std::string mono = slurp(folder_ / "mono" / "frames.bin");
  ASSERT_EQ(mono.size(), 5 * kMonoStride);
  for (int i = 0; i < 5; ++i)
    EXPECT_EQ(mono.substr(i * kMonoStride, kPixels), stereo.substr(i * kStereoStride, kPixels))
        << i;
  EXPECT_EQ(header["sensor"], "mono");
  EXPECT_EQ(header["camera"]["bf"], 0);
}

TEST_F(Generator, StoppingLeavesNothing) {
  EXPECT_FALSE(generate(lively(), folder_ / "stopped", 2, [](int done, int) { return done < 3; }));
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(Generator, BadOptionsAreOneLine) {
  GeneratorOptions options = lively();
  options.trajectory = "spiral";
  EXPECT_NE(rejected(options).find("'spiral'"), std::string::npos);
  options = lively();
  options.sensor = "lidar";
  EXPECT_NE(rejected(options).find("'lidar'"), std::string::npos);
  options = lively();
  options.trajectory = (folder_ / "none.txt").string();
  EXPECT_NE(rejected(options).find("none.txt"), std::string::npos);
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST(Sha256, KnownDigests) {  // FIPS 180-4 examples
  EXPECT_EQ(sha256_hex(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(sha256_hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256_hex("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
}

}  // namespace
}  // namespace slambed::synth
