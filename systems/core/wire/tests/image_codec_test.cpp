// SPDX-License-Identifier: Apache-2.0
#include "wire/image_codec.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "wire/tests/examples.hpp"

namespace slambed::wire {
namespace {

constexpr int kWidth = 160, kHeight = 120;

double largest_difference(const GrayImage& a, const GrayImage& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i)
    largest = std::max(largest, std::abs(double(a.pixels[i]) - double(b.pixels[i])));
  return largest;
}

TEST(ImageCodec, APictureComesBackAsItWasAndSmallerWithLessQuality) {
  const GrayImage picture = example_picture(kWidth, kHeight);
  const Bytes fine = encode_jpeg(picture.view(), 95), coarse = encode_jpeg(picture.view(), 20);
  const GrayImage back = decode_jpeg(fine, kWidth, kHeight);
  EXPECT_EQ(back.width, kWidth);
  EXPECT_EQ(back.pixels.size(), picture.pixels.size());
  EXPECT_LE(largest_difference(picture, back), 12);
  EXPECT_GT(largest_difference(picture, decode_jpeg(coarse, kWidth, kHeight)),
            largest_difference(picture, back));
  EXPECT_LT(coarse.size() * 2, fine.size());
  EXPECT_EQ(encode_jpeg(picture.view(), 95), fine);
}

TEST(ImageCodec, APartOfALargerPictureIsCodedAlone) {
  const GrayImage picture = example_picture(kWidth, kHeight);
  const GrayView part{picture.pixels.data() + 5 * kWidth + 7, 64, 48, kWidth};
  GrayImage copy{64, 48, {}};
  for (int y = 0; y < 48; ++y) copy.pixels.insert(copy.pixels.end(), part.row(y), part.row(y) + 64);
  EXPECT_EQ(encode_jpeg(part, 90), encode_jpeg(copy.view(), 90));
}

TEST(ImageCodec, SaysInOneLineWhatIsWrongWithAPicture) {
  const Bytes jpeg = encode_jpeg(example_picture(kWidth, kHeight).view(), 90);
  const auto complaint = [](std::span<const std::uint8_t> bytes, int width, int height) {
    try {
      decode_jpeg(bytes, width, height);
    } catch (const DecodeError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  EXPECT_EQ(complaint(jpeg, kWidth, kHeight), "accepted");
  EXPECT_EQ(complaint(jpeg, 640, 480), "JPEG is 160x120 px, announced were 640x480");
  EXPECT_EQ(complaint({}, kWidth, kHeight).substr(0, 8), "no JPEG:");
  const auto first_half = std::span(jpeg).first(jpeg.size() / 2);
  EXPECT_EQ(complaint(first_half, kWidth, kHeight), "JPEG is torn: its end mark is not its end");
  EXPECT_THROW(check_jpeg(first_half, kWidth, kHeight), DecodeError);
  Bytes hollow(first_half.begin(), first_half.end());
  hollow.insert(hollow.end(), {0xFF, 0xD9});
  EXPECT_NO_THROW(check_jpeg(hollow, kWidth, kHeight));
  const std::string damaged = complaint(hollow, kWidth, kHeight);
  EXPECT_EQ(damaged.substr(0, 16), "JPEG is damaged:");
  EXPECT_EQ(damaged.find('\n'), std::string::npos);
}

TEST(ImageCodec, NeitherCutsNorWrongBitsEverCrashIt) {
  const Bytes jpeg = encode_jpeg(example_picture(64, 48).view(), 60);
  const auto tried = [](std::span<const std::uint8_t> bytes) {
    try {
      const GrayImage image = decode_jpeg(bytes, 64, 48);
      EXPECT_EQ(image.pixels.size(), 64u * 48u);
    } catch (const DecodeError&) {
    }
  };
  for (std::size_t size = 0; size < jpeg.size(); ++size) tried(std::span(jpeg).first(size));
  for (std::size_t bit = 0; bit < jpeg.size() * 8; ++bit) {
    Bytes wrong = jpeg;
    wrong[bit / 8] ^= static_cast<std::uint8_t>(1u << (bit % 8));
    tried(wrong);
  }
}

}  // namespace
}  // namespace slambed::wire
