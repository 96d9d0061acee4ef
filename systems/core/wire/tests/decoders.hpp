// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "features/default_vocabulary.hpp"
#include "wire/compatibility_codec.hpp"
#include "wire/delta_codec.hpp"
#include "wire/frame_messages.hpp"
#include "wire/handover_messages.hpp"
#include "wire/mask_codec.hpp"
#include "wire/message_type.hpp"
#include "wire/reloc_messages.hpp"
#include "wire/tests/decoder_target.hpp"
#include "wire/tests/examples.hpp"
#include "wire/trip_messages.hpp"

namespace slambed::wire {

inline RelocOk example_found(std::mt19937& random, const SensorPtr& sensor, int features) {
  RelocOk found{.number = 300,
                .times = {RunTime(5), RunTime(9)},
                .update = 12,
                .jumped = true,
                .T_cw = SE3(),
                .matches = {},
                .keyframe = fresh_keyframe(random, sensor, features, features)};
  for (std::size_t i = 0; i < found.keyframe.points.size(); ++i)
    found.matches.emplace_back(static_cast<std::uint16_t>(i), found.keyframe.points[i].id);
  return found;
}

inline FrameImage example_frame_image() {
  return {.frame_index = 300,
          .timestamp_s = 10,
          .captured = RunTime(5'000'000),
          .dequeued = RunTime(6'000'000),
          .jpeg = encode_jpeg(example_picture(40, 30).view(), 60)};
}

inline FrameResult example_frame_result() {
  FrameResult result{.sequence = 9,
                     .frame_index = 300,
                     .state = FrameState::kOk,
                     .reset = false,
                     .T_cw = SE3::exp(Eigen::Matrix<double, 6, 1>::Constant(0.1)),
                     .reference = keyframe_id(7),
                     .T_cr = SE3(),
                     .features = 900,
                     .inliers = 200,
                     .times = {},
                     .masks = example_masks(40, 30)};
  result.times.captured = RunTime(5'000'000);
  result.times.nrcc = Duration(150'000'000);
  return result;
}

/// The same messages as text, with few features because the grid alone makes them long.
inline std::vector<Target> text_targets(std::mt19937& random, const SensorPtr& sensor) {
  const auto vocabulary = default_vocabulary();
  KeyFrameMessage keyframe{.keyframe = keyframe_id(40),
                           .captured = {},
                           .delta = example_keyframe(random, sensor, 6, 2, 2)};
  keyframe.delta.observation_counts = {{point_id(12), 1000, 70}};
  MapUpdate update{.update = 1,
                   .newest = keyframe_id(40),
                   .times = {},
                   .map = keyframe.delta,
                   .poses = {{keyframe_id(8), SE3(), 9}}};
  FrameMessage frame{3, 0.5, example_features(random, 5, sensor)};
  const RelocOk found = example_found(random, sensor, 6);
  // Direct reading must survive the same bytes; the result of the streams decides.
  const auto both = [](auto decode) {
    return [=, direct = std::make_shared<DirectText>()](auto bytes) {
      try {
        decode(bytes, direct.get());
      } catch (const DecodeError&) {  // the streams must refuse it too
      }
      decode(bytes, nullptr);
    };
  };
  return {
      {"reloc_request_text", encode_text(RelocRequest{300, 7, frame}, *vocabulary),
       both([=](auto b, DirectText* m) { decode_reloc_request_text(b, sensor, m); })},
      {"reloc_ok_text", encode_text(found, frame, *vocabulary),
       both([=](auto b, DirectText* m) { decode_reloc_ok_text(b, sensor, m); })},
      {"keyframe_text", encode_text(keyframe, {}, *vocabulary),
       both([=](auto b, DirectText* m) { decode_keyframe_text(b, sensor, m); })},
      {"update_text", encode_text(update, *vocabulary),
       both([=](auto b, DirectText* m) { decode_update_text(b, sensor, m); })},
      {"frame_text", encode_text(frame, *vocabulary),
       both([=](auto b, DirectText* m) { decode_frame_text(b, sensor, m); })},
  };
}

/// Every decoder of this layer with a valid message.
inline std::vector<Target> targets() {
  std::mt19937 random(11);
  const auto sensor = example_camera().make_sensor();
  const MapDelta delta = example_delta(random, sensor);
  KeyFrameMessage keyframe{.keyframe = keyframe_id(40), .captured = {}, .delta = delta};
  MapUpdate update{
      .update = 1, .newest = keyframe_id(40), .times = {}, .map = delta, .poses = delta.poses};
  FrameMessage frame{3, 0.5, example_features(random, 40, sensor)};
  Hello hello{.wire_version = kWireVersion,
              .channel = "map",
              .run_key = "k",
              .system = "s",
              .sensor = example_camera()};
  std::vector<Target> all = {
      {"delta", encode(delta), [=](auto b) { decode_delta(b, sensor); }},
      {"keyframe", encode(keyframe), [=](auto b) { decode_keyframe(b, sensor); }},
      {"update", encode(update), [=](auto b) { decode_update(b, sensor); }},
      {"fresh", encode(fresh_keyframe(random, sensor, 30, 12), FreshPoints::kDerived),
       [=](auto b) { decode_delta(b, sensor); }},
      {"frame", encode(frame), [=](auto b) { decode_frame(b, sensor); }},
      {"poses", encode_poses(delta.poses), [](auto b) { decode_poses(b); }},
      {"ack", encode(AckMessage{300}), [](auto b) { decode_ack(b); }},
      {"announce", encode(AnnounceMessage{300, RunTime(7), 70'000}),
       [](auto b) { decode_announce(b); }},
      {"bye", encode(ByeMessage{300, 5, 7}), [](auto b) { decode_bye(b); }},
      {"state", encode(StateMessage{2, 300, RunTime(5), Duration(7)}),
       [](auto b) { decode_state(b); }},
      {"stop", encode(StopMessage{300}), [](auto b) { decode_stop(b); }},
      {"start", encode(StartMessage{300, 4}), [](auto b) { decode_start(b); }},
      {"handover", encode(MapHandover{.epoch = 3, .number = 4, .whole = true, .changes = delta}),
       [=](auto b) { decode_handover(b, sensor); }},
      {"handover_ack", encode(HandoverAck{3, 4, HandoverAnswer::kAccepted}),
       [](auto b) { decode_handover_ack(b); }},
      {"reloc_request", encode(RelocRequest{300, 7, frame}),
       [=](auto b) { decode_reloc_request(b, sensor); }},
      {"reloc_fail", encode(RelocFail{300, {RunTime(5), RunTime(9)}, RelocFailure::kNoMap, 20}),
       [](auto b) { decode_reloc_fail(b); }},
      {"reloc_ok", encode(example_found(random, sensor, 30)),
       [=](auto b) { decode_reloc_ok(b, sensor); }},
      {"suspend", encode(SuspendMessage{300}), [](auto b) { decode_suspend(b); }},
      {"resume", encode(ResumeMessage{300, keyframe_id(40)}), [](auto b) { decode_resume(b); }},
      {"pose_answer", encode(PoseAnswer{.keyframe = keyframe_id(3), .matches = 300, .T_cw = SE3()}),
       [](auto b) { defect(decode_pose_answer(b)); }},
      {"filled", fill_up({1, 2, 3}, 20), [](auto b) { without_filler(b); }},
      {"trip_keyframe", fill_up(encode(keyframe), 0),
       [=](auto b) { decode_keyframe(without_filler(b), sensor); }},
      {"hello", encode(hello), [](auto b) { decode_hello(b); }},
      {"jpeg", encode_jpeg(example_picture(40, 30).view(), 60),
       [](auto b) { decode_jpeg(b, 40, 30); }},
      {"frame_image", encode(example_frame_image()), [](auto b) { decode_frame_image(b); }},
      {"frame_result", encode(example_frame_result()),
       [=](auto b) { decode_frame_result(b, example_frame_camera()); }},
      {"masks", encode_masks(example_masks(40, 30)), [](auto b) { decode_masks(b, 40, 30); }},
      {"segmentation", encode_segmentation(example_masks(40, 30)),
       [](auto b) { decode_segmentation(2, b, 40, 30); }},
  };
  for (Target& target : text_targets(random, sensor)) all.push_back(std::move(target));
  return all;
}

}  // namespace slambed::wire
