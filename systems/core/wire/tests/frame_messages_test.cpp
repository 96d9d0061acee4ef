// SPDX-License-Identifier: Apache-2.0
#include "wire/frame_messages.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "wire/mask_codec.hpp"
#include "wire/tests/decoders.hpp"

namespace slambed::wire {
namespace {

TEST(FrameMessages, APictureArrivesWithItsTimes) {
  const FrameImage sent = example_frame_image();
  const FrameImage came = decode_frame_image(encode(sent));
  EXPECT_EQ(came.frame_index, sent.frame_index);
  EXPECT_EQ(came.timestamp_s, sent.timestamp_s);
  EXPECT_EQ(came.captured, sent.captured);
  EXPECT_EQ(came.dequeued, sent.dequeued);
  EXPECT_EQ(came.jpeg, sent.jpeg);
}

TEST(FrameMessages, AResultArrivesWithPoseTimesAndMasks) {
  const FrameResult sent = example_frame_result();
  const FrameResult came = decode_frame_result(encode(sent), example_frame_camera());
  EXPECT_EQ(came.state, FrameState::kOk);
  EXPECT_LT((came.T_cw.t - sent.T_cw.t).norm(), 1e-12);
  EXPECT_EQ(came.reference, sent.reference);
  EXPECT_EQ(came.times.captured, sent.times.captured);
  EXPECT_EQ(came.times.nrcc, sent.times.nrcc);
  EXPECT_EQ(came.masks.instances.size(), sent.masks.instances.size());
}

TEST(FrameMessages, AFrameWithoutAPoseHasNone) {
  FrameResult lost = example_frame_result();
  const std::size_t with_pose = encode(lost).size();
  lost.state = FrameState::kLost;
  EXPECT_LT(encode(lost).size(), with_pose);
  EXPECT_EQ(decode_frame_result(encode(lost), example_frame_camera()).state, FrameState::kLost);
}

TEST(FrameMessages, RefusesMasksOfAnotherPictureAndPartsBackInTime) {
  const FrameResult valid = example_frame_result();
  EXPECT_THROW(decode_frame_result(encode(valid), example_camera().make_sensor()), DecodeError);
  EXPECT_THROW(decode_frame_result(encode(valid), nullptr), DecodeError);
  FrameResult backwards = valid;
  backwards.times.track = -Duration(1);
  EXPECT_THROW(decode_frame_result(encode(backwards), example_frame_camera()), DecodeError);
}

TEST(Masks, ComeBackToThePixel) {
  const FrameMasks sent = example_masks(40, 30);
  const FrameMasks came = decode_masks(encode_masks(sent), 40, 30);
  ASSERT_EQ(came.instances.size(), 2u);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(came.instances[i].runs, sent.instances[i].runs);
    EXPECT_EQ(came.instances[i].object_class, sent.instances[i].object_class);
    EXPECT_EQ(came.instances[i].moves, sent.instances[i].moves);
    EXPECT_EQ(came.instances[i].score, sent.instances[i].score);
  }
  ASSERT_TRUE(came.instances[0].body);
  EXPECT_EQ((*came.instances[0].body)[3].v, (*sent.instances[0].body)[3].v);
  EXPECT_EQ((*came.instances[0].body)[4].visibility, BodyPoint::Visibility::kHidden);
  EXPECT_FALSE(came.instances[1].body);
}

TEST(Masks, ASegmentationComesBackWhole) {
  const FrameMasks sent = example_masks(40, 30);
  const FrameMasks came = decode_segmentation(2, encode_segmentation(sent), 40, 30);
  EXPECT_EQ(encode_masks(came), encode_masks(sent));
  EXPECT_THROW(decode_segmentation(1, encode_segmentation(sent), 40, 30), DecodeError);
  EXPECT_THROW(decode_segmentation(101, encode_segmentation(sent), 40, 30), DecodeError);
  EXPECT_TRUE(decode_segmentation(0, encode_segmentation({40, 30, {}}), 40, 30).instances.empty());
}

/// The people are three ellipses, 200 to 280 px high, with key points.
TEST(Masks, ThreePeopleTakeAtMostTwoKilobytes) {
  constexpr int kWidth = 640, kHeight = 480;
  FrameMasks masks{kWidth, kHeight, {}};
  for (const auto& [x, half_width, half_height] :
       {std::array{150, 50, 120}, {330, 60, 140}, {500, 40, 100}}) {
    Instance person{.object_class = 0, .moves = true, .score = 0.9f, .runs = {}, .body = {}};
    person.body.emplace();
    for (BodyPoint& point : *person.body) point = {float(x), 240.5f, BodyPoint::Visibility::kSeen};
    std::uint32_t outside = 0;
    for (int y = 0; y < kHeight; ++y) {
      const double off = (y - kHeight / 2) / double(half_height);
      const int half = std::abs(off) < 1 ? int(half_width * std::sqrt(1 - off * off)) : 0;
      if (half == 0) {
        outside += kWidth;
        continue;
      }
      person.runs.push_back(outside + static_cast<std::uint32_t>(x - half));
      person.runs.push_back(static_cast<std::uint32_t>(2 * half));
      outside = static_cast<std::uint32_t>(kWidth - x - half);
    }
    person.runs.push_back(outside);
    masks.instances.push_back(person);
  }
  const Bytes bytes = encode_masks(masks);
  EXPECT_LE(bytes.size(), 2048u);
  EXPECT_EQ(decode_masks(bytes, kWidth, kHeight).instances[1].runs, masks.instances[1].runs);
}

TEST(Masks, AreRefusedWhenTheyCannotBe) {
  const auto complaint = [](const FrameMasks& masks) {
    try {
      decode_masks(encode_masks(masks), 40, 30);
    } catch (const DecodeError& error) {
      return std::string(error.what());
    }
    return std::string("accepted");
  };
  const FrameMasks valid = example_masks(40, 30);
  EXPECT_EQ(complaint(valid), "accepted");
  EXPECT_EQ(complaint(example_masks(41, 30)), "masks are of a picture of another size");
  FrameMasks wrong = valid;
  wrong.instances[0].runs.back() += 1;
  EXPECT_EQ(complaint(wrong), "masks: the runs of a mask do not cover the picture");
  wrong = valid;
  wrong.instances[0].runs = {40, 0, 1160};
  EXPECT_EQ(complaint(wrong), "masks: a run of a mask is empty");
  wrong = valid;
  wrong.instances[1].score = 1.5f;
  EXPECT_EQ(complaint(wrong), "masks: a score is not within 0 and 1");
  wrong = valid;
  wrong.instances.resize(101, valid.instances[1]);
  EXPECT_EQ(complaint(wrong), "masks: there are too many instances");
}

}  // namespace
}  // namespace slambed::wire
