// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "edgeslam_semantic/messages.hpp"
#include "wire/tests/decoder_target.hpp"
#include "wire/tests/examples.hpp"

namespace slambed::edgeslam_semantic {

using wire::DecodeError, wire::encode_jpeg, wire::example_camera, wire::example_masks;
using wire::example_picture, wire::fresh_keyframe, wire::keyframe_id, wire::point_id;

inline SemanticKeyFrame example_semantic_keyframe(std::mt19937& random, const SensorPtr& sensor) {
  SemanticKeyFrame message{.map_id = keyframe_id(2),
                           .captured = RunTime(5'000'000),
                           .applied_slice = 300,
                           .newest_edge_point = point_id(77, IdSpace::kEdgeMapper),
                           .n_m = 0.7,
                           .delta = fresh_keyframe(random, sensor, 30, 12),
                           .jpeg = encode_jpeg(example_picture(40, 30).view(), 60)};
  message.delta.attach = {{keyframe_id(4), 3, message.delta.points.front().id}};
  return message;
}

inline OptResult example_opt_result() {
  OptResult message{.map_id = keyframe_id(2),
                    .number = 300,
                    .keyframe = keyframe_id(9),
                    .T_cw = SE3::exp(Eigen::Matrix<double, 6, 1>::Constant(0.1)),
                    .times = {},
                    .changes = {},
                    .left_keyframes = {keyframe_id(3), keyframe_id(4)},
                    .left_points = {point_id(77)}};
  message.times.mapped = RunTime(5'000'000);
  message.changes.positions = {{point_id(5), {1, -2, 3.5}, 0}, {point_id(6), {0, 0.25, 4}, 0}};
  message.changes.poses = {{keyframe_id(9), SE3(), 0}};
  message.changes.attach = {{keyframe_id(9), 700, point_id(5)}};
  message.changes.detach = {{keyframe_id(9), 2, point_id(6)}};
  message.changes.culled_points = {point_id(8)};
  message.changes.culled_keyframes = {keyframe_id(5)};
  message.changes.fusions = {{point_id(10), point_id(5)}};
  return message;
}

inline MaskMessage example_mask() {
  return {.map_id = keyframe_id(2),
          .keyframe = keyframe_id(9),
          .took = Duration(150'000'000),
          .masks = example_masks(40, 30)};
}

inline NoMaskMessage example_no_mask() {
  return {.map_id = keyframe_id(2),
          .keyframe = keyframe_id(9),
          .took = Duration(2'000'000'000),
          .reason = NoMaskReason::kNotMapped};
}

/// Returns every decoder of this system with a valid message.
inline std::vector<wire::Target> targets() {
  std::mt19937 random(11);
  const auto sensor = example_camera().make_sensor();
  return {
      {"keyframe", encode(example_semantic_keyframe(random, sensor)),
       [=](auto b) { decode_semantic_keyframe(b, sensor); }},
      {"opt_result", encode(example_opt_result()), [](auto b) { decode_opt_result(b); }},
      {"mask", encode(example_mask()),
       [](auto b) { decode_mask(b, wire::example_frame_camera()); }},
      {"no_mask", encode(example_no_mask()), [](auto b) { decode_no_mask(b); }},
      {"keyframe_refused", encode(KeyFrameRefused{300}),
       [](auto b) { decode_keyframe_refused(b); }},
  };
}

}  // namespace slambed::edgeslam_semantic
