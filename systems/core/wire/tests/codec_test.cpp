// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.hpp"
#include "wire/delta_codec.hpp"
#include "wire/feature_codec.hpp"
#include "wire/message_type.hpp"
#include "wire/tests/examples.hpp"

namespace slambed::wire {
namespace {

class Codec : public ::testing::Test {
 protected:
  std::mt19937 random{5};
  std::shared_ptr<const Sensor> sensor = example_camera().make_sensor();
};

void expect_same_pose(const SE3& a, const SE3& b) {
  EXPECT_LT((a.R - b.R).norm(), 1e-14);
  EXPECT_EQ(a.t, b.t);
}

TEST_F(Codec, FeaturesComeBackWithinTheStatedLoss) {
  const auto features = example_features(random, 1000, sensor);
  ByteWriter out;
  put_features(out, *features);
  EXPECT_EQ(out.size(), 1000 * kFeatureBytes + 2);
  const Bytes bytes = out.take();
  ByteReader in(bytes);
  const auto back = get_features(in, sensor);
  ASSERT_EQ(back->size(), features->size());
  for (int i = 0; i < back->size(); ++i) {
    const KeyPoint& a = features->keypoint(i);
    const KeyPoint& b = back->keypoint(i);
    EXPECT_NEAR(a.u, b.u, 0.0055);
    EXPECT_NEAR(a.v, b.v, 0.0055);
    EXPECT_EQ(a.has_depth(), b.has_depth());
    if (a.has_depth()) {
      EXPECT_NEAR(a.depth_m / b.depth_m, 1, 1.23e-4);
      EXPECT_NEAR(a.right_u, b.right_u, 0.012);
    } else {
      EXPECT_LT(b.right_u, 0);
    }
    EXPECT_NEAR(std::remainder(a.angle_deg - b.angle_deg, 360.f), 0, 0.045);
    EXPECT_EQ(a.octave, b.octave);
    EXPECT_EQ(features->descriptor(i), back->descriptor(i));
  }
}

TEST_F(Codec, TimesThatCannotBeCalculatedWithAreRefused) {
  const MapDelta delta = example_keyframe(random, sensor, 20, 5, 5);
  for (const RunTime time : {RunTime::max(), RunTime::min()}) {
    const KeyFrameMessage keyframe{.keyframe = keyframe_id(40), .captured = time, .delta = delta};
    EXPECT_THROW(decode_keyframe(encode(keyframe), sensor), DecodeError);
    for (const auto part : {&UpdateTimes::captured, &UpdateTimes::mapped, &UpdateTimes::due}) {
      MapUpdate update{
          .update = 1, .newest = keyframe_id(40), .times = {}, .map = delta, .poses = {}};
      update.times.*part = time;
      EXPECT_THROW(decode_update(encode(update), sensor), DecodeError);
    }
    EXPECT_THROW(decode_announce(encode(AnnounceMessage{1, time, 2})), DecodeError);
  }
}

TEST_F(Codec, QuantizingTwiceChangesNothingMore) {
  const auto features = example_features(random, 300, sensor);
  ByteWriter first, second;
  put_features(first, *features);
  const Bytes once = first.take();
  ByteReader in(once);
  put_features(second, *get_features(in, sensor));
  EXPECT_EQ(once, second.take());
}

TEST(DepthCode, CoversItsRangeAndNothingElse) {
  EXPECT_EQ(quantize_depth(-1), 0);
  EXPECT_EQ(quantize_depth(0), 0);
  EXPECT_EQ(quantize_depth(0.0624f), 0);
  EXPECT_EQ(quantize_depth(4096), 0);
  EXPECT_EQ(quantize_depth(std::numeric_limits<float>::quiet_NaN()), 0);
  EXPECT_EQ(restore_depth(quantize_depth(0.0625f)), 0.0625f);
  EXPECT_NEAR(restore_depth(quantize_depth(4095.9f)), 4095.9f, 1);
  EXPECT_LT(restore_depth(0), 0);
  for (std::uint32_t code = 1; code <= UINT16_MAX; ++code) {
    ASSERT_EQ(quantize_depth(restore_depth(static_cast<std::uint16_t>(code))), code);
  }
}

TEST_F(Codec, DeltaComesBackWhole) {
  const MapDelta delta = example_delta(random, sensor);
  const MapDelta back = decode_delta(encode(delta), sensor);
  EXPECT_EQ(back.epoch, delta.epoch);
  ASSERT_EQ(back.keyframes.size(), 1u);
  EXPECT_EQ(back.keyframes[0].id, delta.keyframes[0].id);
  EXPECT_EQ(back.keyframes[0].parent, delta.keyframes[0].parent);
  EXPECT_EQ(back.keyframes[0].frame_index, delta.keyframes[0].frame_index);
  EXPECT_EQ(back.keyframes[0].timestamp_s, delta.keyframes[0].timestamp_s);
  EXPECT_EQ(back.keyframes[0].points, delta.keyframes[0].points);
  expect_same_pose(back.keyframes[0].T_cw, delta.keyframes[0].T_cw);
  ASSERT_EQ(back.points.size(), delta.points.size());
  for (std::size_t i = 0; i < back.points.size(); ++i) {
    const NewPoint &a = delta.points[i], &b = back.points[i];
    EXPECT_EQ(a.id, b.id);
    EXPECT_LT((a.p_w - b.p_w).norm(), 1e-6 * a.p_w.norm());
    EXPECT_EQ(a.appearance.descriptor, b.appearance.descriptor);
    EXPECT_LT((a.appearance.normal - b.appearance.normal).norm(), 3e-5);
    EXPECT_EQ(a.appearance.max_distance_m, b.appearance.max_distance_m);
    EXPECT_EQ(a.appearance.min_distance_m, b.appearance.min_distance_m);
    EXPECT_EQ(a.reference, b.reference);
    EXPECT_EQ(a.first_keyframe, b.first_keyframe);
    EXPECT_EQ(a.visible, b.visible);
    EXPECT_EQ(a.found, b.found);
    EXPECT_EQ(a.version, b.version);
  }
  ASSERT_EQ(back.attach.size(), 2u);
  EXPECT_EQ(back.attach[1].feature, 999);
  EXPECT_EQ(back.attach[1].keyframe, keyframe_id(9));
  EXPECT_EQ(back.attach[1].point, point_id(6));
  ASSERT_EQ(back.detach.size(), 1u);
  EXPECT_EQ(back.detach[0].point, point_id(8));
  EXPECT_EQ(back.fusions.at(0).survivor, point_id(11, IdSpace::kEdgeMapper));
  EXPECT_EQ(back.positions.at(0).p_w, Eigen::Vector3d(1, 2, 3.5));
  EXPECT_EQ(back.positions.at(0).version, 4u);
  EXPECT_EQ(back.poses.at(0).version, 9u);
  expect_same_pose(back.poses.at(0).T_cw, delta.poses[0].T_cw);
  EXPECT_EQ(back.observation_counts.at(0).visible, 1000u);
  EXPECT_EQ(back.culled_points, delta.culled_points);
  EXPECT_EQ(back.culled_keyframes, delta.culled_keyframes);
}

TEST_F(Codec, FreshPointsAreMadeAgainFromTheirFeatures) {
  const MapDelta delta = fresh_keyframe(random, sensor, 400, 300);
  const MapDelta back = decode_delta(encode(delta, FreshPoints::kDerived), sensor);
  ASSERT_EQ(back.points.size(), delta.points.size());
  const Eigen::Vector3d center = delta.keyframes[0].T_cw.inverse().t;
  for (std::size_t i = 0; i < back.points.size(); ++i) {
    const NewPoint &a = delta.points[i], &b = back.points[i];
    EXPECT_EQ(a.id, b.id);
    EXPECT_LT((a.p_w - b.p_w).norm(), 2e-4 * (a.p_w - center).norm());
    EXPECT_EQ(a.appearance.descriptor, b.appearance.descriptor);
    EXPECT_LT((a.appearance.normal - b.appearance.normal).norm(), 2e-4);
    EXPECT_NEAR(a.appearance.max_distance_m, b.appearance.max_distance_m, 2e-3);
    EXPECT_NEAR(a.appearance.min_distance_m, b.appearance.min_distance_m, 2e-3);
    EXPECT_EQ(a.reference, b.reference);
    EXPECT_EQ(a.first_keyframe, b.first_keyframe);
    EXPECT_EQ(b.visible, 1u);
    EXPECT_EQ(b.found, 1u);
    EXPECT_EQ(b.version, 0u);
  }
  // Quantizing a second time changes nothing.
  const Bytes again = encode(back, FreshPoints::kDerived);
  const MapDelta twice = decode_delta(again, sensor);
  for (std::size_t i = 0; i < back.points.size(); ++i)
    EXPECT_LT((twice.points[i].p_w - back.points[i].p_w).norm(), 1e-9);
}

TEST_F(Codec, AFreshPointCostsItsIdAndAChangedOneAllOfItself) {
  MapDelta delta = fresh_keyframe(random, sensor, 400, 300);
  const std::size_t size = encode(delta, FreshPoints::kDerived).size();
  EXPECT_LT(size, 400 * kFeatureBytes + 300 * (2 + 4) + 200);
  EXPECT_GT(encode(delta).size(), size + 300 * 20);  // without derived points
  const auto cost_of = [&](auto change) {
    MapDelta changed = delta;
    change(changed.points[7]);
    return encode(changed, FreshPoints::kDerived).size() - size;
  };
  constexpr std::size_t kWhole = 20;
  EXPECT_GT(cost_of([](NewPoint& p) { p.version = 1; }), kWhole);
  EXPECT_GT(cost_of([](NewPoint& p) { p.visible = 2; }), kWhole);
  EXPECT_GT(cost_of([](NewPoint& p) { p.p_w.z() += 0.01; }), kWhole);
  EXPECT_GT(cost_of([](NewPoint& p) { p.appearance.descriptor[0] ^= 1; }), kWhole);
  EXPECT_GT(cost_of([](NewPoint& p) { p.first_keyframe = keyframe_id(3); }), kWhole);
}

TEST_F(Codec, FewBytesCannotAskForManyPoints) {
  MapDelta delta = fresh_keyframe(random, sensor, 20, 5);
  for (NewPoint& point : delta.points) point.version = 1;  // makes them not fresh
  const NewPoint one = delta.points.front();
  delta.points.clear();
  Bytes bytes = encode(delta);
  delta.points.push_back(one);
  const Bytes with_one = encode(delta);
  const auto place = static_cast<std::size_t>(
      std::mismatch(bytes.begin(), bytes.end(), with_one.begin()).first - bytes.begin());
  ASSERT_EQ(bytes[place], 0);  // the number of points
  bytes[place] = 100;
  bytes.resize(bytes.size() + 400);  // enough for 100 fresh points, but only 5 features have one
  EXPECT_THROW(decode_delta(bytes, sensor), DecodeError);
}

TEST_F(Codec, EmptyDeltaNeedsNoCamera) {
  const Bytes bytes = encode(MapDelta{});
  EXPECT_TRUE(decode_delta(bytes, nullptr).empty());
  EXPECT_LE(bytes.size(), 12u);
  EXPECT_THROW(decode_delta(encode(example_delta(random, sensor)), nullptr), DecodeError);
}

TEST_F(Codec, KeyFrameWithItsPointsStaysBelowFiftyKilobytes) {
  KeyFrameMessage message;
  message.keyframe = keyframe_id(40);
  message.delta = example_keyframe(random, sensor, 1000, 350, 200);
  EXPECT_EQ(message.delta.points.size(), 200u);
  EXPECT_LE(encode(message).size(), 50'000u);
  message.delta = fresh_keyframe(random, sensor, 1000, 700);
  EXPECT_EQ(message.delta.points.size(), 700u);
  EXPECT_LE(encode(message).size(), 45'000u);
}

TEST_F(Codec, MessagesComeBack) {
  KeyFrameMessage keyframe;
  keyframe.keyframe = keyframe_id(40);
  keyframe.captured = RunTime(-17);
  keyframe.urgent = keyframe.after_relocalization = true;
  keyframe.whole = true;
  keyframe.applied_update = 6;
  keyframe.newest_edge_point = point_id(77, IdSpace::kEdgeMapper);
  keyframe.delta = example_keyframe(random, sensor, 50, 10, 10);
  const auto keyframe_back = decode_keyframe(encode(keyframe), sensor);
  EXPECT_EQ(keyframe_back.keyframe, keyframe.keyframe);
  EXPECT_EQ(keyframe_back.captured, keyframe.captured);
  EXPECT_TRUE(keyframe_back.urgent && keyframe_back.after_relocalization && !keyframe_back.first &&
              keyframe_back.whole);
  EXPECT_EQ(keyframe_back.applied_update, 6u);
  EXPECT_EQ(keyframe_back.newest_edge_point, keyframe.newest_edge_point);
  EXPECT_EQ(keyframe_back.delta.points.size(), 10u);

  MapUpdate update;
  update.update = 12;
  update.newest = keyframe_id(40);
  update.newest_past_probation = keyframe_id(37);
  update.times = {RunTime(1), RunTime(2), RunTime(3), RunTime(4), RunTime(5), RunTime(6)};
  update.map = keyframe.delta;
  update.poses = {{keyframe_id(1), SE3(), 3}};
  const auto update_back = decode_update(encode(update), sensor);
  EXPECT_EQ(update_back.update, 12u);
  EXPECT_EQ(update_back.newest, update.newest);
  EXPECT_EQ(update_back.newest_past_probation, update.newest_past_probation);
  EXPECT_EQ(update_back.times.captured, RunTime(1));
  EXPECT_EQ(update_back.times.due, RunTime(6));
  EXPECT_EQ(update_back.poses.at(0).id, keyframe_id(1));

  const auto features = example_features(random, 20, sensor);
  const auto frame_back = decode_frame(encode(FrameMessage{77, 2.5, features}), sensor);
  EXPECT_EQ(frame_back.frame_index, 77u);
  EXPECT_EQ(frame_back.features->size(), 20);
  EXPECT_EQ(decode_ack(encode(AckMessage{1234567})).sequence, 1234567u);
  const auto announce = decode_announce(encode(AnnounceMessage{5, RunTime(6), 7}));
  EXPECT_EQ(announce.sequence, 5u);
  EXPECT_EQ(announce.queued, RunTime(6));
  EXPECT_EQ(announce.bytes, 7u);
  const auto bye = decode_bye(encode(ByeMessage{1, 2, 3}));
  EXPECT_EQ(bye.last_keyframe_sequence + bye.keyframes * 10 + bye.points * 100, 321u);
}

TEST_F(Codec, OnlyAMapThatStartsComesAsTwoKeyFrames) {
  const auto single = example_single_camera().make_sensor();
  KeyFrameMessage two;
  two.keyframe = keyframe_id(40);
  two.first = true;
  two.delta = example_start(random, single);
  const MapDelta back = decode_keyframe(encode(two), single).delta;
  ASSERT_EQ(back.keyframes.size(), 2u);
  EXPECT_EQ(back.keyframes[0].id, keyframe_id(39));
  EXPECT_EQ(back.keyframes[0].points, two.delta.keyframes[0].points);
  EXPECT_EQ(back.keyframes[1].id, keyframe_id(40));
  EXPECT_EQ(back.points.size(), two.delta.points.size());
  KeyFrameMessage other = two;
  other.first = false;
  EXPECT_THROW(encode(other), Error);
  other = two;
  other.keyframe = keyframe_id(39);  // the id of the earlier one
  EXPECT_THROW(decode_keyframe(encode(other), single), DecodeError);
  other = two;
  other.delta.keyframes.push_back(two.delta.keyframes.back());
  EXPECT_THROW(encode(other), Error);
  other.delta.keyframes.clear();
  EXPECT_THROW(encode(other), Error);
}

TEST_F(Codec, MessagesThatContradictThemselvesAreRefused) {
  KeyFrameMessage keyframe;
  keyframe.keyframe = keyframe_id(41);  // not the id of the keyframe inside
  keyframe.delta = example_keyframe(random, sensor, 50, 10, 10);
  EXPECT_THROW(decode_keyframe(encode(keyframe), sensor), DecodeError);
  MapUpdate empty;
  empty.newest = keyframe_id(1);
  EXPECT_THROW(decode_update(encode(empty), sensor), DecodeError);
  const auto coarse = [] {
    SensorInfo info = example_camera();
    info.levels = 2;
    return info.make_sensor();
  }();
  keyframe.keyframe = keyframe_id(40);
  EXPECT_THROW(decode_keyframe(encode(keyframe), coarse), DecodeError);  // octaves above level 1
}

TEST(Hello, ComesBackAndKnowsItsPeer) {
  Hello mobile{.wire_version = kWireVersion,
               .role = NodeRole::kMobile,
               .channel = "map",
               .run_key = "abc",
               .system = "edgeslam",
               .sensor = example_camera()};
  Hello edge = mobile;
  edge.role = NodeRole::kEdge;
  edge.sensor.reset();
  const Hello back = decode_hello(encode(mobile));
  EXPECT_FALSE(mismatch(edge, back));
  EXPECT_FALSE(mismatch(mobile, decode_hello(encode(edge))));
  ASSERT_TRUE(back.sensor);
  EXPECT_EQ(back.sensor->camera.fx, 527);
  EXPECT_EQ(back.sensor->make_sensor()->pyramid.levels(), 8);
  EXPECT_TRUE(mismatch(mobile, mobile));
  for (auto member : {&Hello::channel, &Hello::run_key, &Hello::system}) {
    Hello other = mobile;
    other.*member = "other";
    EXPECT_TRUE(mismatch(edge, other));
  }
  Hello blind = mobile;
  blind.sensor.reset();
  EXPECT_TRUE(mismatch(edge, blind));
  for (const int step : {-1, 1}) {
    Hello of_another_version = mobile;
    of_another_version.wire_version = kWireVersion + step;
    EXPECT_THROW(decode_hello(encode(of_another_version)), DecodeError) << step;
  }
  Hello flat = mobile;
  flat.sensor->camera.width = 0;
  EXPECT_THROW(decode_hello(encode(flat)), DecodeError);
}

}  // namespace
}  // namespace slambed::wire
