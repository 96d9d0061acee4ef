// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <random>

#include "features/instances.hpp"
#include "map/appearance.hpp"
#include "wire/hello.hpp"
#include "wire/image_codec.hpp"
#include "wire/messages.hpp"

namespace slambed::wire {

inline SensorInfo example_camera() {
  SensorInfo info;
  info.camera = {
      .width = 640, .height = 480, .fx = 527, .fy = 527, .cx = 322, .cy = 238, .bf = 15.8};
  info.close_depth_m = 1.2f;
  return info;
}

/// A camera with images of 40x30 px, the size of the example masks in most tests.
inline SensorPtr example_frame_camera() {
  SensorInfo info = example_camera();
  info.camera.width = 40;
  info.camera.height = 30;
  return info.make_sensor();
}

inline SensorInfo example_single_camera() {
  SensorInfo info = example_camera();
  info.camera.bf = 0;
  info.close_depth_m = 0;
  return info;
}

inline std::shared_ptr<const FeatureSet> example_features(std::mt19937& random, int count,
                                                          std::shared_ptr<const Sensor> sensor) {
  std::uniform_real_distribution<float> unit(0, 1);
  std::vector<KeyPoint> keypoints(static_cast<std::size_t>(count));
  std::vector<Descriptor> descriptors(keypoints.size());
  for (std::size_t i = 0; i < keypoints.size(); ++i) {
    KeyPoint& k = keypoints[i];
    k.u = unit(random) * 639;
    k.v = unit(random) * 479;
    k.angle_deg = unit(random) * 359.9f;
    k.octave = static_cast<std::uint8_t>(random() % 8);
    if (sensor->metric() && random() % 5 != 0) {
      k.depth_m = 0.4f + unit(random) * 6;
      k.right_u = k.u - static_cast<float>(sensor->camera.bf) / k.depth_m;
    }
    for (auto& word : descriptors[i]) word = (std::uint64_t{random()} << 32) | random();
  }
  return std::make_shared<const FeatureSet>(sensor, std::move(keypoints), std::move(descriptors));
}

inline KeyFrameId keyframe_id(std::uint64_t index) { return {std::uint64_t{1} << 56 | index}; }
inline MapPointId point_id(std::uint64_t index, IdSpace space = IdSpace::kTracker) {
  return {static_cast<std::uint64_t>(space) << 56 | index};
}

/// A keyframe that observes `known` earlier points and creates `fresh` ones, as tracking does.
inline MapDelta example_keyframe(std::mt19937& random, std::shared_ptr<const Sensor> sensor,
                                 int features, int known, int fresh) {
  MapDelta delta;
  delta.epoch = 3;
  NewKeyFrame keyframe;
  keyframe.id = keyframe_id(40);
  keyframe.frame_index = 512;
  keyframe.timestamp_s = 17.066;
  keyframe.features = example_features(random, features, sensor);
  keyframe.T_cw =
      SE3::exp((Eigen::Matrix<double, 6, 1>() << 0.3, -2, 1, 0.1, 0.7, -0.2).finished());
  keyframe.points.resize(static_cast<std::size_t>(features));
  keyframe.parent = keyframe_id(39);
  for (int i = 0; i < known + fresh; ++i) {
    auto& slot = keyframe.points[static_cast<std::size_t>(i) * features / (known + fresh)];
    if (i % 2 == 0 ? i / 2 < known : i / 2 >= fresh) {
      const IdSpace space = random() % 3 ? IdSpace::kEdgeMapper : IdSpace::kMobileMapper;
      slot = point_id(1 + random() % 8000, space);
      continue;
    }
    NewPoint point;
    point.id = point_id(9000 + static_cast<std::uint64_t>(i));
    point.p_w = Eigen::Vector3d(1.5, -0.25, 3) * (0.1 + i % 7);
    point.reference = point.first_keyframe = keyframe.id;
    point.appearance.descriptor =
        keyframe.features->descriptors()[static_cast<std::size_t>(&slot - keyframe.points.data())];
    point.appearance.normal = Eigen::Vector3f(0.6f, 0, 0.8f);
    point.appearance.max_distance_m = 3.5f;
    point.appearance.min_distance_m = 3.5f / sensor->pyramid.scale.back();
    slot = point.id;
    delta.points.push_back(point);
  }
  delta.keyframes.push_back(std::move(keyframe));
  return delta;
}

/// A keyframe that creates `fresh` points from its first features with depth, as tracking does.
inline MapDelta fresh_keyframe(std::mt19937& random, std::shared_ptr<const Sensor> sensor,
                               int features, int fresh) {
  MapDelta delta = example_keyframe(random, sensor, features, 0, 1);
  delta.points.clear();
  NewKeyFrame& keyframe = delta.keyframes.front();
  keyframe.points.assign(keyframe.points.size(), {});
  for (int i = 0; i < features && std::ssize(delta.points) < fresh; ++i) {
    const KeyPoint& seen = keyframe.features->keypoint(i);
    if (!seen.has_depth()) continue;
    NewPoint point;
    point.id = point_id(9000 + static_cast<std::uint64_t>(i));
    point.p_w = keyframe.T_cw.inverse() * sensor->camera.unproject(seen.u, seen.v, seen.depth_m);
    point.appearance = appearance_of(point.p_w, keyframe.T_cw, *keyframe.features, i);
    point.reference = point.first_keyframe = keyframe.id;
    keyframe.points[static_cast<std::size_t>(i)] = point.id;
    delta.points.push_back(point);
  }
  return delta;
}

/// The start of a monocular map: two keyframes, and points without appearance.
inline MapDelta example_start(std::mt19937& random, std::shared_ptr<const Sensor> sensor) {
  MapDelta delta = example_keyframe(random, sensor, 30, 0, 12);
  delta.keyframes.push_back(delta.keyframes.front());
  delta.keyframes.front().id = keyframe_id(39);
  delta.keyframes.front().parent = {};
  delta.keyframes.back().parent = keyframe_id(39);
  for (NewPoint& point : delta.points) point.appearance = {};
  return delta;
}

/// A delta with something in every list.
inline MapDelta example_delta(std::mt19937& random, std::shared_ptr<const Sensor> sensor) {
  MapDelta delta = example_keyframe(random, sensor, 60, 20, 20);
  NewPoint odd = delta.points.front();  // nothing of it can be derived from the keyframe
  odd.id = point_id(7, IdSpace::kEdgeMapper);
  odd.appearance.descriptor = {1, 2, 3, 4};
  odd.appearance.min_distance_m = 0.125f;
  odd.reference = keyframe_id(3);
  odd.first_keyframe = keyframe_id(2);
  odd.visible = 300;
  odd.found = 299;
  odd.version = 12;
  delta.points.push_back(odd);
  delta.attach = {{keyframe_id(2), 17, point_id(5)}, {keyframe_id(9), 999, point_id(6)}};
  delta.detach = {{keyframe_id(2), 18, point_id(8)}};
  delta.fusions = {{point_id(10), point_id(11, IdSpace::kEdgeMapper)}};
  delta.positions = {{point_id(12), {1, 2, 3.5}, 4}};
  delta.poses = {{keyframe_id(8), SE3::exp(Eigen::Matrix<double, 6, 1>::Constant(0.1)), 9}};
  delta.observation_counts = {{point_id(12), 1000, 70}};
  delta.culled_points = {point_id(1), point_id(2)};
  delta.culled_keyframes = {keyframe_id(4)};
  return delta;
}

/// An image of gradients, an edge and noise.
inline GrayImage example_picture(int width, int height) {
  std::mt19937 random(3);
  GrayImage image{width, height, {}};
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      image.pixels.push_back(
          static_cast<std::uint8_t>((x + 2 * y) / 4 + (x > width / 3 ? 80 : 0) + random() % 16));
  return image;
}

/// A person with key points, and a car that covers the first pixels.
inline FrameMasks example_masks(int width, int height) {
  const auto pixels = static_cast<std::uint32_t>(width * height);
  Instance person{
      .object_class = 0, .moves = true, .score = 0.75f, .runs = {40, 7, pixels - 47}, .body = {}};
  person.body.emplace();
  for (int i = 0; i < kBodyPoints; ++i)
    (*person.body)[i] = {float(i), 2.5f * float(i), BodyPoint::Visibility(i % 3)};
  const Instance car{
      .object_class = 2, .moves = true, .score = 0.5f, .runs = {0, 3, pixels - 3}, .body = {}};
  return {width, height, {person, car}};
}

}  // namespace slambed::wire
