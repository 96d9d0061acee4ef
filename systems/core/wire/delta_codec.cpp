// SPDX-License-Identifier: Apache-2.0
#include "wire/delta_codec.hpp"

#include <cmath>

#include "wire/feature_codec.hpp"
#include "wire/id_codec.hpp"
#include "wire/unit_rotation.hpp"

namespace slambed::wire {
namespace {

constexpr std::size_t kPoseBytes = 56;

struct Streams {
  IdStream points, keyframes;
};

void put_keyframe(ByteWriter& out, Streams& ids, const NewKeyFrame& keyframe) {
  ids.keyframes.put(out, keyframe.id);
  ids.keyframes.put(out, keyframe.parent);
  out.varint(keyframe.frame_index);
  out.f64(keyframe.timestamp_s);
  put_pose(out, keyframe.T_cw);
  out.varint(keyframe.version);
  put_features(out, *keyframe.features);
  for (const MapPointId id : keyframe.points) ids.points.put(out, id);
}

NewKeyFrame get_keyframe(ByteReader& in, Streams& ids,
                         const std::shared_ptr<const Sensor>& sensor) {
  if (!sensor) throw DecodeError("keyframe from an unknown camera");
  NewKeyFrame keyframe;
  keyframe.id = ids.keyframes.get<KeyFrameId>(in);
  keyframe.parent = ids.keyframes.get_or_none<KeyFrameId>(in);
  keyframe.frame_index = in.varint();
  keyframe.timestamp_s = in.f64();
  keyframe.T_cw = get_pose(in);
  keyframe.version = in.varint32();
  keyframe.features = get_features(in, sensor);
  keyframe.points.resize(static_cast<std::size_t>(keyframe.features->size()));
  for (MapPointId& id : keyframe.points) id = ids.points.get_or_none<MapPointId>(in);
  return keyframe;
}

template <typename T, typename Put>
void put_list(ByteWriter& out, const std::vector<T>& list, Put put) {
  out.varint(list.size());
  for (const T& item : list) put(item);
}

template <typename T, typename Get>
void get_list(ByteReader& in, std::vector<T>& list, std::size_t min_bytes, Get get) {
  const std::size_t count = in.count(min_bytes);
  list.reserve(count);
  for (std::size_t i = 0; i < count; ++i) list.push_back(get());
}

void put_edits(ByteWriter& out, Streams& ids, const std::vector<ObservationEdit>& edits) {
  put_list(out, edits, [&](const ObservationEdit& edit) {
    ids.keyframes.put(out, edit.keyframe);
    out.varint(edit.feature);
    ids.points.put(out, edit.point);
  });
}

void get_edits(ByteReader& in, Streams& ids, std::vector<ObservationEdit>& edits) {
  get_list(in, edits, 3, [&] {
    ObservationEdit edit;
    edit.keyframe = ids.keyframes.get<KeyFrameId>(in);
    const std::uint32_t feature = in.varint32();
    if (feature >= kMaxFeatures) throw DecodeError("feature is out of range");
    edit.feature = static_cast<std::uint16_t>(feature);
    edit.point = ids.points.get<MapPointId>(in);
    return edit;
  });
}

}  // namespace

void put_pose(ByteWriter& out, const SE3& pose) {
  const Eigen::Quaterniond q = pose.quaternion();
  for (const double value : {q.w(), q.x(), q.y(), q.z()}) out.f64(value);
  for (const double value : pose.t) out.f64(value);
}

SE3 get_pose(ByteReader& in) {
  Eigen::Quaterniond q;
  for (double* value : {&q.w(), &q.x(), &q.y(), &q.z()}) *value = in.f64();
  if (!is_unit(q)) throw DecodeError("rotation is none");
  Eigen::Vector3d t;
  for (double& value : t) value = in.f64();
  return {q, t};
}

void put_poses(ByteWriter& out, const std::vector<KeyFramePose>& poses) {
  IdStream ids;
  put_list(out, poses, [&](const KeyFramePose& pose) {
    ids.put(out, pose.id);
    put_pose(out, pose.T_cw);
    out.varint(pose.version);
  });
}

std::vector<KeyFramePose> get_poses(ByteReader& in) {
  IdStream ids;
  std::vector<KeyFramePose> poses;
  get_list(in, poses, kPoseBytes + 2, [&] {
    KeyFramePose pose;
    pose.id = ids.get<KeyFrameId>(in);
    pose.T_cw = get_pose(in);
    pose.version = in.varint32();
    return pose;
  });
  return poses;
}

void put_delta(ByteWriter& out, const MapDelta& delta, FreshPoints fresh) {
  Streams ids;
  out.varint(delta.epoch);
  put_list(out, delta.keyframes, [&](const NewKeyFrame& k) { put_keyframe(out, ids, k); });
  PointCodec points(delta.keyframes, fresh);
  put_list(out, delta.points, [&](const NewPoint& p) { points.put(out, ids.points, p); });
  put_edits(out, ids, delta.attach);
  put_edits(out, ids, delta.detach);
  put_list(out, delta.fusions, [&](const PointFusion& fusion) {
    ids.points.put(out, fusion.gone);
    ids.points.put(out, fusion.survivor);
  });
  put_list(out, delta.positions, [&](const PointPosition& position) {
    ids.points.put(out, position.id);
    for (const double value : position.p_w) out.f32(static_cast<float>(value));
    out.varint(position.version);
  });
  put_poses(out, delta.poses);
  put_list(out, delta.observation_counts, [&](const PointObservationCounts& observation_counts) {
    ids.points.put(out, observation_counts.id);
    out.varint(observation_counts.visible);
    out.varint(observation_counts.found);
  });
  put_list(out, delta.culled_points, [&](MapPointId id) { ids.points.put(out, id); });
  put_list(out, delta.culled_keyframes, [&](KeyFrameId id) { ids.keyframes.put(out, id); });
}

MapDelta get_delta(ByteReader& in, const std::shared_ptr<const Sensor>& sensor) {
  Streams ids;
  MapDelta delta;
  delta.epoch = in.varint();
  get_list(in, delta.keyframes, kPoseBytes + 13, [&] { return get_keyframe(in, ids, sensor); });
  PointCodec points(delta.keyframes);
  const std::size_t count = points.get_count(in);
  delta.points.reserve(count);
  for (std::size_t i = 0; i < count; ++i) delta.points.push_back(points.get(in, ids.points));
  get_edits(in, ids, delta.attach);
  get_edits(in, ids, delta.detach);
  get_list(in, delta.fusions, 2, [&] {
    const auto gone = ids.points.get<MapPointId>(in);
    return PointFusion{gone, ids.points.get<MapPointId>(in)};
  });
  get_list(in, delta.positions, 14, [&] {
    PointPosition position;
    position.id = ids.points.get<MapPointId>(in);
    for (double& value : position.p_w) value = in.f32();
    position.version = in.varint32();
    return position;
  });
  delta.poses = get_poses(in);
  get_list(in, delta.observation_counts, 3, [&] {
    const auto id = ids.points.get<MapPointId>(in);
    const std::uint32_t visible = in.varint32();
    return PointObservationCounts{id, visible, in.varint32()};
  });
  get_list(in, delta.culled_points, 1, [&] { return ids.points.get<MapPointId>(in); });
  get_list(in, delta.culled_keyframes, 1, [&] { return ids.keyframes.get<KeyFrameId>(in); });
  return delta;
}

Bytes encode(const MapDelta& delta, FreshPoints fresh) {
  ByteWriter out;
  put_delta(out, delta, fresh);
  return out.take();
}

MapDelta decode_delta(std::span<const std::uint8_t> bytes,
                      const std::shared_ptr<const Sensor>& sensor) {
  ByteReader in(bytes);
  MapDelta delta = get_delta(in, sensor);
  in.expect_end();
  return delta;
}

}  // namespace slambed::wire
