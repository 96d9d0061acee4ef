// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/messages.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "edgeslam_semantic/tests/message_examples.hpp"
#include "map/map.hpp"
#include "wire/tests/decoder_checks.hpp"

namespace slambed::edgeslam_semantic {
namespace {

TEST(SemanticMessages, AKeyFrameArrivesWithPointsAndPicture) {
  std::mt19937 random(5);
  const auto sensor = example_camera().make_sensor();
  const SemanticKeyFrame sent = example_semantic_keyframe(random, sensor);
  const SemanticKeyFrame came = decode_semantic_keyframe(encode(sent), sensor);
  EXPECT_EQ(came.map_id, sent.map_id);
  EXPECT_EQ(came.keyframe(), sent.keyframe());
  EXPECT_FALSE(came.first());
  EXPECT_EQ(came.captured, sent.captured);
  EXPECT_EQ(came.applied_slice, sent.applied_slice);
  EXPECT_EQ(came.newest_edge_point, sent.newest_edge_point);
  EXPECT_EQ(came.n_m, sent.n_m);
  EXPECT_EQ(came.jpeg, sent.jpeg);
  EXPECT_EQ(came.delta.points.size(), sent.delta.points.size());
  EXPECT_EQ(came.delta.attach.size(), sent.delta.attach.size());
}

/// A monocular map starts with two keyframes, and its points carry no appearance.
TEST(SemanticMessages, TheBeginningOfAMapOfOneCameraCrosses) {
  std::mt19937 random(6);
  const auto sensor = example_camera().make_sensor();
  const MapDelta begin = wire::example_start(random, sensor);
  const SemanticKeyFrame sent{.map_id = keyframe_id(40), .delta = begin, .jpeg = {}};
  const SemanticKeyFrame came = decode_semantic_keyframe(encode(sent), sensor);
  EXPECT_TRUE(came.first());
  ASSERT_EQ(came.delta.keyframes.size(), 2u);
  ASSERT_EQ(came.delta.points.size(), begin.points.size());
  EXPECT_TRUE(came.jpeg.empty());
  for (std::size_t i = 0; i < begin.points.size(); ++i)
    EXPECT_LT((came.delta.points[i].p_w - begin.points[i].p_w).norm(), 1e-5);
  Map map;
  map.commit(came.delta);
  map.read([&](const MapView& view) {
    EXPECT_GT(view.point(begin.points.front().id)->appearance.max_distance_m, 0);
    return 0;
  });
}

TEST(SemanticMessages, AResultArrivesWhole) {
  const OptResult sent = example_opt_result();
  const OptResult came = decode_opt_result(encode(sent));
  EXPECT_EQ(came.map_id, sent.map_id);
  EXPECT_EQ(came.number, sent.number);
  EXPECT_EQ(came.keyframe, sent.keyframe);
  EXPECT_LT((came.T_cw.t - sent.T_cw.t).norm(), 1e-12);
  EXPECT_EQ(came.times.mapped, sent.times.mapped);
  EXPECT_EQ(came.changes.positions.size(), 2u);
  EXPECT_EQ(came.changes.fusions.front().survivor, point_id(5));
  EXPECT_EQ(came.left_keyframes, sent.left_keyframes);
  EXPECT_EQ(came.left_points, sent.left_points);
}

TEST(SemanticMessages, AMaskOfThreePeopleIsSmall) {
  constexpr std::uint32_t kWidth = 640, kHeight = 480;
  MaskMessage sent{.map_id = keyframe_id(2), .keyframe = keyframe_id(9), .masks = {}};
  sent.masks = {kWidth, kHeight, {}};
  // Each person is half as high as the picture, and the outline shifts by a pixel or two per row.
  for (std::uint32_t person = 0; person < 3; ++person) {
    Instance instance{.object_class = 0, .moves = true, .score = 0.9f, .runs = {}, .body = {}};
    std::uint32_t pixels = 0, outside = 120 * kWidth + 100 + 150 * person;
    for (std::uint32_t row = 0; row < 240; ++row) {
      const std::uint32_t wide = 60 + row % 3;
      instance.runs.insert(instance.runs.end(), {outside, wide});
      pixels += outside + wide;
      outside = kWidth - wide + row % 2;
    }
    instance.runs.push_back(kWidth * kHeight - pixels);
    sent.masks.instances.push_back(instance);
  }
  const Bytes bytes = encode(sent);
  EXPECT_LE(bytes.size(), 2048u);
  wire::SensorInfo camera = example_camera();
  camera.camera.width = kWidth;
  camera.camera.height = kHeight;
  const MaskMessage came = decode_mask(bytes, camera.make_sensor());
  EXPECT_EQ(came.keyframe, sent.keyframe);
  EXPECT_EQ(came.masks.instances.back().runs, sent.masks.instances.back().runs);
  EXPECT_THROW(decode_mask(bytes, wire::example_frame_camera()), DecodeError);
  EXPECT_THROW(decode_mask(bytes, nullptr), DecodeError);
}

TEST(SemanticMessages, ARefusalSaysOfWhichUpload) {
  EXPECT_EQ(decode_keyframe_refused(encode(KeyFrameRefused{1234567})).sequence, 1234567u);
}

TEST(SemanticMessages, ThatThereIsNoMaskSaysOfWhatAndWhy) {
  for (const auto reason : {NoMaskReason::kNotSegmented, NoMaskReason::kNotMapped}) {
    NoMaskMessage sent = example_no_mask();
    sent.reason = reason;
    Bytes bytes = encode(sent);
    const NoMaskMessage came = decode_no_mask(bytes);
    EXPECT_EQ(came.map_id, sent.map_id);
    EXPECT_EQ(came.keyframe, sent.keyframe);
    EXPECT_EQ(came.took, sent.took);
    EXPECT_EQ(came.reason, reason);
    bytes.back() = 2;
    EXPECT_THROW(decode_no_mask(bytes), DecodeError);
  }
  NoMaskMessage before = example_no_mask();
  before.took = Duration(-1);
  EXPECT_THROW(decode_no_mask(encode(before)), DecodeError);
}

TEST(SemanticMessages, RefusesWhatMakesNoSense) {
  std::mt19937 random(5);
  const auto sensor = example_camera().make_sensor();
  const SemanticKeyFrame valid = example_semantic_keyframe(random, sensor);
  EXPECT_THROW(decode_semantic_keyframe(encode(valid), nullptr), DecodeError);
  for (const double n_m : {-0.1, 1.5, std::numeric_limits<double>::quiet_NaN()}) {
    SemanticKeyFrame wrong = valid;
    wrong.n_m = n_m;
    EXPECT_THROW(decode_semantic_keyframe(encode(wrong), sensor), DecodeError) << n_m;
  }
  SemanticKeyFrame none = valid;
  none.delta.keyframes.clear();
  none.delta.points.clear();
  EXPECT_THROW(decode_semantic_keyframe(encode(none), sensor), DecodeError);
  SemanticKeyFrame many = valid;
  for (int i = 0; i < kMostSemanticKeyFrames; ++i)
    many.delta.keyframes.push_back(valid.delta.keyframes.front());
  EXPECT_THROW(decode_semantic_keyframe(encode(many), sensor), DecodeError);
  OptResult whole = example_opt_result();
  whole.changes.keyframes = valid.delta.keyframes;
  EXPECT_THROW(decode_opt_result(encode(whole)), DecodeError);
}

TEST(SemanticMessages, DecodersTakeWhatIsValidAndSurviveTheRest) {
  accept_the_valid_message(targets());
  refuse_every_truncation_and_extension(targets());
  survive_flipped_bits(targets());
  survive_random_damage(targets());
  survive_random_bytes(targets());
}

}  // namespace
}  // namespace slambed::edgeslam_semantic
