// SPDX-License-Identifier: Apache-2.0
// The text form of Edge-SLAM's messages is lossless and as large as theirs.
#include "wire/compatibility_codec.hpp"

#include <gtest/gtest.h>

#include "features/default_vocabulary.hpp"
#include "wire/delta_codec.hpp"
#include "wire/direct_text.hpp"
#include "wire/tests/examples.hpp"
#include "wire/text_archive.hpp"

namespace slambed::wire {
namespace {

class Compatibility : public ::testing::Test {
 protected:
  /// A keyframe with new points. Adds its known points to `known`, to be written by value.
  KeyFrameMessage keyframe(int features, int known_points, int fresh) {
    KeyFrameMessage message;
    message.keyframe = keyframe_id(40);
    message.delta = example_keyframe(random, sensor, features, known_points, fresh);
    for (const MapPointId id : message.delta.keyframes[0].points) {
      if (!id || id.value >> kSpaceShift == static_cast<std::uint64_t>(IdSpace::kTracker)) continue;
      NewPoint point = message.delta.points.at(0);
      point.id = id;
      known.push_back(point);
    }
    return message;
  }
  static constexpr int kSpaceShift = 56;

  std::mt19937 random{5};
  std::shared_ptr<const Sensor> sensor = example_camera().make_sensor();
  std::shared_ptr<const Vocabulary> vocabulary = default_vocabulary();
  std::vector<NewPoint> known;
};

void expect_equal(const FeatureSet& a, const FeatureSet& b) {
  ASSERT_EQ(a.size(), b.size());
  for (int i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a.keypoint(i).u, b.keypoint(i).u);
    EXPECT_EQ(a.keypoint(i).v, b.keypoint(i).v);
    EXPECT_EQ(a.keypoint(i).right_u, b.keypoint(i).right_u);
    EXPECT_EQ(a.keypoint(i).depth_m, b.keypoint(i).depth_m);
    EXPECT_EQ(a.keypoint(i).angle_deg, b.keypoint(i).angle_deg);
    EXPECT_EQ(a.keypoint(i).octave, b.keypoint(i).octave);
    EXPECT_EQ(a.descriptor(i), b.descriptor(i));
  }
}

void expect_equal(const NewPoint& a, const NewPoint& b) {
  EXPECT_EQ(a.id, b.id);
  EXPECT_EQ(a.p_w.cast<float>(), b.p_w.cast<float>());
  EXPECT_EQ(a.appearance.descriptor, b.appearance.descriptor);
  EXPECT_EQ(a.appearance.normal, b.appearance.normal);
  EXPECT_EQ(a.appearance.min_distance_m, b.appearance.min_distance_m);
  EXPECT_EQ(a.appearance.max_distance_m, b.appearance.max_distance_m);
  EXPECT_EQ(a.reference, b.reference);
  EXPECT_EQ(a.first_keyframe, b.first_keyframe);
  EXPECT_EQ(a.visible, b.visible);
  EXPECT_EQ(a.found, b.found);
  EXPECT_EQ(a.version, b.version);
}

TEST_F(Compatibility, KeyFrameComesBackExactlyWithItsNewPointsOnly) {
  KeyFrameMessage message = keyframe(200, 60, 40);
  message.captured = RunTime(-17);
  message.urgent = message.after_relocalization = true;
  message.applied_update = 6;
  message.newest_edge_point = point_id(77, IdSpace::kEdgeMapper);
  message.delta.observation_counts = {{point_id(3), 1000, 70},
                                      {point_id(4, IdSpace::kEdgeMapper), 5, 5}};
  const auto back = decode_keyframe_text(encode_text(message, known, *vocabulary), sensor);
  EXPECT_EQ(back.keyframe, message.keyframe);
  EXPECT_EQ(back.captured, message.captured);
  EXPECT_TRUE(back.urgent && back.after_relocalization && !back.first);
  EXPECT_EQ(back.applied_update, 6u);
  EXPECT_EQ(back.newest_edge_point, message.newest_edge_point);
  EXPECT_EQ(back.delta.epoch, message.delta.epoch);
  const NewKeyFrame &a = message.delta.keyframes.at(0), &b = back.delta.keyframes.at(0);
  EXPECT_EQ(a.frame_index, b.frame_index);
  EXPECT_EQ(a.timestamp_s, b.timestamp_s);
  EXPECT_EQ(a.parent, b.parent);
  EXPECT_EQ(a.points, b.points);
  EXPECT_LT((a.T_cw.R - b.T_cw.R).norm(), 1e-14);
  EXPECT_EQ(a.T_cw.t, b.T_cw.t);
  expect_equal(*a.features, *b.features);
  ASSERT_EQ(back.delta.observation_counts.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(back.delta.observation_counts[i].id, message.delta.observation_counts[i].id);
    EXPECT_EQ(back.delta.observation_counts[i].visible,
              message.delta.observation_counts[i].visible);
    EXPECT_EQ(back.delta.observation_counts[i].found, message.delta.observation_counts[i].found);
  }
  ASSERT_EQ(back.delta.points.size(), 40u);
  for (std::size_t i = 0; i < 40; ++i) expect_equal(message.delta.points[i], back.delta.points[i]);
}

TEST_F(Compatibility, TheTwoKeyFramesThatASingleCamerasMapBeginsWithCross) {
  sensor = example_single_camera().make_sensor();
  KeyFrameMessage sent;
  sent.keyframe = keyframe_id(40);
  sent.first = true;
  sent.delta = example_start(random, sensor);
  const auto came = decode_keyframe_text(encode_text(sent, {}, *vocabulary), sensor);
  EXPECT_EQ(came.keyframe, sent.keyframe);
  ASSERT_EQ(came.delta.keyframes.size(), 2u);
  for (std::size_t k = 0; k < 2; ++k) {
    EXPECT_EQ(came.delta.keyframes[k].id, sent.delta.keyframes[k].id);
    EXPECT_EQ(came.delta.keyframes[k].points, sent.delta.keyframes[k].points);
  }
  ASSERT_EQ(came.delta.points.size(), sent.delta.points.size());  // each point once
  // A message that restarts a map contains one keyframe.
  sent.delta.keyframes.erase(sent.delta.keyframes.begin());
  EXPECT_EQ(decode_keyframe_text(encode_text(sent, {}, *vocabulary), sensor).delta.keyframes.size(),
            1u);
}

TEST_F(Compatibility, ATimeThatCannotBeCalculatedWithIsRefused) {
  KeyFrameMessage message = keyframe(20, 5, 5);
  message.captured = RunTime::max();
  EXPECT_THROW(decode_keyframe_text(encode_text(message, known, *vocabulary), sensor), DecodeError);
}

TEST_F(Compatibility, UpdateHoldsEachPointOnce) {
  MapUpdate update;
  update.update = 12;
  update.newest = keyframe_id(40);
  update.newest_past_probation = keyframe_id(37);
  update.times = {RunTime(1), RunTime(2), RunTime(3), RunTime(4), RunTime(5), RunTime(6)};
  update.map = keyframe(60, 0, 40).delta;
  update.map.keyframes.push_back(update.map.keyframes[0]);  // observes the same points
  update.map.keyframes[1].id = keyframe_id(41);
  update.poses = {{keyframe_id(1), SE3(), 3}};
  const auto back = decode_update_text(encode_text(update, *vocabulary), sensor);
  EXPECT_EQ(back.update, 12u);
  EXPECT_EQ(back.newest, update.newest);
  EXPECT_EQ(back.newest_past_probation, update.newest_past_probation);
  EXPECT_EQ(back.times.captured, RunTime(1));
  EXPECT_EQ(back.times.due, RunTime(6));
  ASSERT_EQ(back.map.keyframes.size(), 2u);
  EXPECT_EQ(back.map.keyframes[1].id, keyframe_id(41));
  EXPECT_EQ(back.map.points.size(), 40u);
  EXPECT_EQ(back.poses.at(0).id, keyframe_id(1));
  EXPECT_EQ(back.poses.at(0).version, 3u);
}

TEST_F(Compatibility, FrameComesBack) {
  const auto features = example_features(random, 20, sensor);
  const auto back =
      decode_frame_text(encode_text(FrameMessage{77, 2.5, features}, *vocabulary), sensor);
  EXPECT_EQ(back.frame_index, 77u);
  EXPECT_EQ(back.timestamp_s, 2.5);
  expect_equal(*features, *back.features);
}

/// Measured with Edge-SLAM's own classes on 640x480 frames of about 1,000 key points: 0.375 MB for
/// a frame, 0.53 MB for a keyframe with 500 points, 0.63 to 0.65 MB with 800 to 860, 3.5 MB for an
/// update of six.
TEST_F(Compatibility, MessagesAreAsLargeAsEdgeSlams) {
  const auto kilobytes = [](const Bytes& bytes) { return static_cast<double>(bytes.size()) / 1e3; };
  const FrameMessage frame{77, 2.5, example_features(random, 1000, sensor)};
  EXPECT_NEAR(kilobytes(encode_text(frame, *vocabulary)), 375, 40);
  const KeyFrameMessage small = keyframe(1000, 300, 200);
  EXPECT_NEAR(kilobytes(encode_text(small, known, *vocabulary)), 530, 55);
  known.clear();
  const KeyFrameMessage large = keyframe(1000, 600, 230);
  EXPECT_NEAR(kilobytes(encode_text(large, known, *vocabulary)), 640, 65);
  MapUpdate update;
  update.update = 1;
  update.newest = keyframe_id(40);
  update.map = keyframe(1000, 0, 700).delta;
  for (std::uint64_t i = 0; i < 5; ++i) {
    update.map.keyframes.push_back(update.map.keyframes[0]);
    update.map.keyframes.back().id = keyframe_id(41 + i);
  }
  EXPECT_NEAR(kilobytes(encode_text(update, *vocabulary)), 3500, 350);
}

TEST_F(Compatibility, ContradictionsAreRefused) {
  KeyFrameMessage message = keyframe(50, 10, 10);
  message.keyframe = keyframe_id(41);  // not the id of the keyframe inside
  EXPECT_THROW(decode_keyframe_text(encode_text(message, known, *vocabulary), sensor), DecodeError);
  message.keyframe = keyframe_id(40);
  SensorInfo coarse = example_camera();
  coarse.levels = 2;
  EXPECT_THROW(decode_keyframe_text(encode_text(message, known, *vocabulary), coarse.make_sensor()),
               DecodeError);
  SensorInfo small = example_camera();
  small.camera.width = 320;
  EXPECT_THROW(decode_keyframe_text(encode_text(message, known, *vocabulary), small.make_sensor()),
               DecodeError);
  EXPECT_THROW(decode_frame_text(encode_text(message, known, *vocabulary), sensor), DecodeError);
}

TEST_F(Compatibility, DirectTextIsThatOfStreams) {
  const KeyFrameMessage message = keyframe(200, 60, 40);
  MapUpdate update;
  update.update = 1;
  update.newest = keyframe_id(40);
  update.map = message.delta;
  update.poses = {{keyframe_id(1), SE3(), 3}};
  const FrameMessage frame{77, 2.5, message.delta.keyframes[0].features};
  DirectText known_texts;
  DirectText* direct = &known_texts;
  const Bytes text = encode_text(message, known, *vocabulary, direct);
  EXPECT_EQ(text, encode_text(message, known, *vocabulary));
  EXPECT_EQ(encode_text(update, *vocabulary, direct), encode_text(update, *vocabulary));
  EXPECT_EQ(encode_text(frame, *vocabulary, direct), encode_text(frame, *vocabulary));

  const auto read = [&](DirectText* means) { return decode_keyframe_text(text, sensor, means); };
  // The binary encoding compares all fields of the messages.
  EXPECT_EQ(encode(read(direct)), encode(read(nullptr)));
  const auto update_text = encode_text(update, *vocabulary);
  EXPECT_EQ(encode(decode_update_text(update_text, sensor, direct)),
            encode(decode_update_text(update_text, sensor)));
  for (std::size_t size = 0; size < text.size(); size += 97)
    EXPECT_THROW(decode_keyframe_text(std::span(text).first(size), sensor, direct), DecodeError);
}

TEST_F(Compatibility, FeaturesThatCameByBeforeAreNeitherReadNorWrittenAgain) {
  DirectText kept;
  const KeyFrameMessage message = keyframe(200, 60, 40);
  const auto read = [&](const Bytes& text) {
    return decode_keyframe_text(text, sensor, &kept).delta.keyframes.at(0).features;
  };
  const Bytes text = encode_text(message, known, *vocabulary, &kept);
  EXPECT_EQ(encode_text(message, known, *vocabulary, &kept), text);
  const auto once = read(text);
  expect_equal(*once, *message.delta.keyframes[0].features);
  EXPECT_NE(once, message.delta.keyframes[0].features) << "what was written may be unreadable";
  EXPECT_EQ(read(text), once);
  // Features that were read are written again with the text they came from.
  FrameMessage frame{7, 0.25, once};
  EXPECT_EQ(encode_text(frame, *vocabulary, &kept), encode_text(frame, *vocabulary));

  const auto same_camera = example_camera().make_sensor();
  EXPECT_EQ(
      decode_keyframe_text(text, same_camera, &kept).delta.keyframes[0].features->sensor_ptr(),
      same_camera);
  // A text that differs in one digit gives other features.
  std::string changed(text.begin(), text.end());
  const std::size_t digit = changed.find('.', changed.find("raw ")) + 1;
  changed[digit] = changed[digit] == '5' ? '6' : '5';
  const Bytes other(changed.begin(), changed.end());
  EXPECT_NE(read(other), once);
  EXPECT_EQ(encode(FrameMessage{7, 0.25, read(other)}),
            encode(FrameMessage{
                7, 0.25, decode_keyframe_text(other, sensor).delta.keyframes.at(0).features}));
}

TEST_F(Compatibility, WhatNoReaderAcceptsIsNotAcceptedBecauseItWasWritten) {
  DirectText kept;
  std::vector<KeyPoint> points(1);
  points[0].depth_m = 5000;
  const auto far = std::make_shared<const FeatureSet>(sensor, points, std::vector<Descriptor>(1));
  const Bytes text = encode_text(FrameMessage{7, 0.25, far}, *vocabulary, &kept);
  for (int twice = 0; twice < 2; ++twice)
    EXPECT_THROW(decode_frame_text(text, sensor, &kept), DecodeError);
}

TEST_F(Compatibility, ATextWhoseLastNumberIsCutOffIsNotTakenForALongerOne) {
  DirectText kept;
  const auto features = example_features(random, 5, sensor);
  kept.keep_read(features, "1 2");
  EXPECT_FALSE(kept.read_before("1 23 ", sensor));
  kept.keep_read(features, "1 2 ");
  EXPECT_EQ(kept.read_before("1 2 3 ", sensor)->length, 4u);
}

TEST_F(Compatibility, TextsOfFeaturesDoNotFillTheMemory) {
  DirectText kept;
  const auto features = [&](float u) {
    std::vector<KeyPoint> points(1);
    points[0].u = u;
    return std::make_shared<const FeatureSet>(sensor, points, std::vector<Descriptor>(1));
  };
  const auto text_of = [&](const DirectText::Features& wanted, int& made) {
    return kept.text_of(wanted, [&] {
      ++made;
      return std::string(DirectText::kMostBytes / 4, ' ');
    });
  };
  std::vector<DirectText::Features> all;
  int made = 0;
  for (int i = 0; i < 5; ++i) {
    all.push_back(features(static_cast<float>(i)));
    text_of(all.back(), made);
    text_of(all.front(), made);  // stays in the cache because it is used
  }
  EXPECT_EQ(made, 5);
  EXPECT_EQ(all[1].use_count(), 1) << "the one not used for longest is gone";
  EXPECT_EQ(all[0].use_count(), 2);
  text_of(all[1], made);
  EXPECT_EQ(made, 6);
}

class TextArchive : public ::testing::TestWithParam<TextMeans> {};

TEST_P(TextArchive, NumbersAreWrittenAsStreamsWriteThem) {
  TextWriter out(GetParam());
  out.integer(INT64_MIN);
  for (const float value : {0.f, -0.f, 0.1f, 1e-45f, -3.4028235e38f, 16777216.f}) out.real(value);
  for (const double value : {5e-324, -1.7976931348623157e308, 1.0 / 3, 2.5}) out.real(value);
  out.word("word");
  EXPECT_EQ(out.take(),
            "-9223372036854775808 0.000000000e+00 -0.000000000e+00 1.000000015e-01 1.401298464e-45 "
            "-3.402823466e+38 1.677721600e+07 4.94065645841246544e-324 -1.79769313486231571e+308 "
            "3.33333333333333315e-01 2.50000000000000000e+00 word ");
}

TEST_P(TextArchive, NumbersComeBackAndOthersAreRefused) {
  TextWriter out(GetParam());
  out.integer(std::int64_t{-5});
  out.real(0.1f);
  out.real(1.0 / 3);
  out.text("a b");
  TextReader in(out.take(), GetParam());
  EXPECT_EQ(in.integer(-5, 5), -5);
  EXPECT_EQ(in.real32(), 0.1f);
  EXPECT_EQ(in.real64(), 1.0 / 3);
  EXPECT_EQ(in.text(), "a b");
  EXPECT_THROW(in.integer(0, 1), DecodeError);
  for (const char* bad : {"6 ", "-6 ", "x ", "", "99999999999999999999 "}) {
    EXPECT_THROW(TextReader(bad, GetParam()).integer(-5, 5), DecodeError) << bad;
  }
  for (const char* bad : {"nan ", "inf ", "1e999 ", "0x", ""}) {
    TextReader reader(bad, GetParam());
    EXPECT_THROW(
        {
          const double value = reader.real64();
          EXPECT_EQ(value, 0);
          reader.real64();
        },
        DecodeError)
        << bad;
  }
  EXPECT_THROW(TextReader("1000000 1 2", GetParam()).count(2), DecodeError);
  EXPECT_THROW(TextReader("5 abc", GetParam()).text(), DecodeError);
}

INSTANTIATE_TEST_SUITE_P(Means, TextArchive,
                         ::testing::Values(TextMeans::kStreams, TextMeans::kDirect));

}  // namespace
}  // namespace slambed::wire
