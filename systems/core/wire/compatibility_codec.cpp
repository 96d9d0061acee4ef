// SPDX-License-Identifier: Apache-2.0
#include "wire/compatibility_codec.hpp"

#include <cmath>
#include <map>
#include <set>

#include "base/run_time_range.hpp"
#include "wire/id_codec.hpp"
#include "wire/text_features.hpp"
#include "wire/unit_rotation.hpp"

namespace slambed::wire {
namespace {

using PointsById = std::map<MapPointId, const NewPoint*>;

constexpr std::uint64_t kIndexMask = (std::uint64_t{1} << kSpaceShift) - 1;
constexpr std::int64_t kAnyCount = UINT32_MAX;
constexpr std::int64_t kAnyNumber = INT64_MAX;

/// Writes an id as two numbers: the id space and the index in that space. "0 0" is no id.
template <typename IdType>
void put_id(TextWriter& out, IdType id) {
  out.integer(id.value >> kSpaceShift);
  out.integer(id.value & kIndexMask);
}

template <typename IdType>
IdType get_id_or_none(TextReader& in) {
  const std::int64_t space = in.integer(0, kIdSpaces);
  const std::int64_t index = in.integer(0, static_cast<std::int64_t>(kMaxIdIndex) - 1);
  if ((space == 0) != (index == 0)) throw DecodeError("id is out of range");
  return IdType{static_cast<std::uint64_t>(space) << kSpaceShift |
                static_cast<std::uint64_t>(index)};
}

template <typename IdType>
IdType get_id(TextReader& in) {
  const auto id = get_id_or_none<IdType>(in);
  if (!id) throw DecodeError("id is missing");
  return id;
}

void put_time(TextWriter& out, RunTime time) { out.integer(time.count()); }
RunTime get_time(TextReader& in) {
  return RunTime(in.integer(-kMaxRunTime.count(), kMaxRunTime.count()));
}

void put_pose(TextWriter& out, const SE3& pose) {
  const Eigen::Quaterniond q = pose.quaternion();
  for (const double value : {q.w(), q.x(), q.y(), q.z()}) out.real(value);
  for (const double value : pose.t) out.real(value);
}

SE3 get_pose(TextReader& in) {
  Eigen::Quaterniond q;
  for (double* value : {&q.w(), &q.x(), &q.y(), &q.z()}) *value = in.real64();
  if (!is_unit(q)) throw DecodeError("rotation is none");
  Eigen::Vector3d t;
  for (double& value : t) value = in.real64();
  return {q, t};
}

/// Writes Edge-SLAM's matrices: Tcw, Twc, camera center and stereo center.
void put_matrices(TextWriter& out, const SE3& T_cw) {
  for (const SE3& T : {T_cw, T_cw.inverse()}) {
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) out.real(static_cast<float>(T.R(row, column)));
      out.real(static_cast<float>(T.t(row)));
    }
    for (const float value : {0.f, 0.f, 0.f, 1.f}) out.real(value);
  }
  for (int twice = 0; twice < 2; ++twice) {
    for (const double value : T_cw.inverse().t) out.real(static_cast<float>(value));
  }
}

void skip_matrices(TextReader& in) {
  for (int i = 0; i < 2 * 16 + 2 * 3; ++i) in.real32();
}

/// Writes the point by value. fresh: the receiver does not have it yet.
void put_point(TextWriter& out, const NewPoint& point, bool fresh, KeyFrameId seen_by,
               std::size_t feature) {
  out.integer(fresh);
  put_id(out, point.first_keyframe);
  put_id(out, point.reference);
  for (const double value : point.p_w) out.real(static_cast<float>(value));
  for (const float value : point.appearance.normal) out.real(value);
  put_descriptor(out, point.appearance.descriptor);
  out.real(point.appearance.min_distance_m);
  out.real(point.appearance.max_distance_m);
  out.integer(point.visible);
  out.integer(point.found);
  out.integer(point.version);
  out.integer(1);  // observations
  put_id(out, seen_by);
  out.integer(feature);
}

/// Returns the point, and whether it is fresh.
std::pair<NewPoint, bool> get_point(TextReader& in, MapPointId id) {
  NewPoint point;
  point.id = id;
  const bool fresh = in.flag();
  point.first_keyframe = get_id_or_none<KeyFrameId>(in);
  point.reference = get_id_or_none<KeyFrameId>(in);
  for (double& value : point.p_w) value = in.real32();
  for (float& value : point.appearance.normal) value = in.real32();
  point.appearance.descriptor = get_descriptor(in);
  point.appearance.min_distance_m = in.real32();
  point.appearance.max_distance_m = in.real32();
  if (point.appearance.min_distance_m < 0 || point.appearance.max_distance_m < 0) {
    throw DecodeError("distance is negative");
  }
  point.visible = static_cast<std::uint32_t>(in.integer(0, kAnyCount));
  point.found = static_cast<std::uint32_t>(in.integer(0, kAnyCount));
  point.version = static_cast<std::uint32_t>(in.integer(0, kAnyCount));
  in.integer(1, 1);
  get_id<KeyFrameId>(in);
  in.integer(0, UINT16_MAX);
  return {point, fresh};
}

std::string keyframe_text(const NewKeyFrame& keyframe, const PointsById& by_value,
                          const std::set<MapPointId>& fresh, const Vocabulary& vocabulary,
                          DirectText* direct) {
  TextWriter out(means_of(direct));
  out.word("keyframe");
  put_id(out, keyframe.id);
  put_id(out, keyframe.parent);
  out.integer(keyframe.frame_index);
  out.real(keyframe.timestamp_s);
  out.integer(keyframe.version);
  put_pose(out, keyframe.T_cw);
  put_matrices(out, keyframe.T_cw);
  put_features(out, keyframe.features, vocabulary, direct);
  for (std::size_t feature = 0; feature < keyframe.points.size(); ++feature) {
    const MapPointId id = keyframe.points[feature];
    put_id(out, id);
    if (!id) continue;
    const auto point = by_value.find(id);
    out.integer(point != by_value.end());
    if (point != by_value.end()) {
      put_point(out, *point->second, fresh.contains(id), keyframe.id, feature);
    }
  }
  return out.take();
}

/// Appends the keyframe and those of its fresh points that are not in `seen` yet.
void take_keyframe(std::string text, const SensorPtr& sensor, MapDelta& delta,
                   std::set<MapPointId>& seen, DirectText* direct) {
  if (!sensor) throw DecodeError("keyframe from an unknown camera");
  TextReader in(std::move(text), means_of(direct));
  NewKeyFrame keyframe;
  in.expect_word("keyframe");
  keyframe.id = get_id<KeyFrameId>(in);
  keyframe.parent = get_id_or_none<KeyFrameId>(in);
  keyframe.frame_index = static_cast<std::uint64_t>(in.integer(0, kAnyNumber));
  keyframe.timestamp_s = in.real64();
  keyframe.version = static_cast<std::uint32_t>(in.integer(0, kAnyCount));
  keyframe.T_cw = get_pose(in);
  skip_matrices(in);
  keyframe.features = get_features(in, sensor, direct);
  keyframe.points.resize(static_cast<std::size_t>(keyframe.features->size()));
  for (MapPointId& id : keyframe.points) {
    id = get_id_or_none<MapPointId>(in);
    if (!id || !in.flag()) continue;
    auto [point, fresh] = get_point(in, id);
    if (fresh && seen.insert(id).second) delta.points.push_back(std::move(point));
  }
  delta.keyframes.push_back(std::move(keyframe));
}

/// Edge-SLAM sends the counters of a point inside the point. We write them there too, to match the
/// size, but those are as old as the local map. The current values are in this list.
void put_observation_counts(TextWriter& out,
                            std::span<const PointObservationCounts> observation_counts) {
  out.integer(observation_counts.size());
  for (const PointObservationCounts& point : observation_counts) {
    put_id(out, point.id);
    out.integer(point.visible);
    out.integer(point.found);
  }
}

std::vector<PointObservationCounts> get_observation_counts(TextReader& in) {
  constexpr std::size_t kLeastObservationCounts = 8;
  std::vector<PointObservationCounts> observation_counts;
  for (std::size_t n = in.count(kLeastObservationCounts); n > 0; --n) {
    PointObservationCounts point;
    point.id = get_id<MapPointId>(in);
    point.visible = static_cast<std::uint32_t>(in.integer(0, kAnyCount));
    point.found = static_cast<std::uint32_t>(in.integer(0, kAnyCount));
    observation_counts.push_back(point);
  }
  return observation_counts;
}

PointsById by_id(std::span<const NewPoint> points) {
  PointsById found;
  for (const NewPoint& point : points) found.emplace(point.id, &point);
  return found;
}

std::set<MapPointId> ids_of(std::span<const NewPoint> points) {
  std::set<MapPointId> ids;
  for (const NewPoint& point : points) ids.insert(point.id);
  return ids;
}

/// A monocular map may start with two keyframes, so only then is their number written.
bool begins_with_two(const KeyFrameMessage& message, const Sensor& sensor) {
  return message.first && !sensor.metric();
}

Bytes finish(TextWriter out) {
  out.word("end");
  const std::string text = out.take();
  return Bytes(text.begin(), text.end());
}

TextReader open(std::span<const std::uint8_t> bytes, std::string_view what, DirectText* direct) {
  TextReader in(std::string(bytes.begin(), bytes.end()), means_of(direct));
  in.expect_word(what);
  return in;
}

}  // namespace

Bytes encode_text(const KeyFrameMessage& message, std::span<const NewPoint> known,
                  const Vocabulary& vocabulary, DirectText* direct) {
  require_keyframes(message);
  TextWriter out(means_of(direct));
  out.word("KEYFRAME");
  put_id(out, message.keyframe);
  put_time(out, message.captured);
  out.integer(message.urgent);
  out.integer(message.first);
  out.integer(message.whole);
  out.integer(message.after_relocalization);
  out.integer(message.applied_update);
  put_id(out, message.newest_edge_point);
  out.integer(message.delta.epoch);
  PointsById by_value = by_id(message.delta.points);
  by_value.merge(by_id(known));
  const auto fresh = ids_of(message.delta.points);
  const auto& keyframes = message.delta.keyframes;
  if (begins_with_two(message, keyframes.back().features->sensor())) out.integer(keyframes.size());
  for (const NewKeyFrame& keyframe : keyframes)
    out.text(keyframe_text(keyframe, by_value, fresh, vocabulary, direct));
  put_observation_counts(out, message.delta.observation_counts);
  return finish(std::move(out));
}

KeyFrameMessage decode_keyframe_text(std::span<const std::uint8_t> bytes, const SensorPtr& sensor,
                                     DirectText* direct) {
  TextReader in = open(bytes, "KEYFRAME", direct);
  KeyFrameMessage message;
  message.keyframe = get_id<KeyFrameId>(in);
  message.captured = get_time(in);
  message.urgent = in.flag();
  message.first = in.flag();
  message.whole = in.flag();
  message.after_relocalization = in.flag();
  message.applied_update = static_cast<std::uint64_t>(in.integer(0, kAnyNumber));
  message.newest_edge_point = get_id_or_none<MapPointId>(in);
  message.delta.epoch = static_cast<std::uint64_t>(in.integer(0, kAnyNumber));
  if (!sensor) throw DecodeError("keyframe from an unknown camera");
  std::set<MapPointId> seen;
  for (auto n = begins_with_two(message, *sensor) ? in.integer(1, 2) : 1; n > 0; --n)
    take_keyframe(in.text(), sensor, message.delta, seen, direct);
  message.delta.observation_counts = get_observation_counts(in);
  in.expect_end();
  expect_keyframes(message);
  return message;
}

Bytes encode_text(const MapUpdate& message, const Vocabulary& vocabulary, DirectText* direct) {
  TextWriter out(means_of(direct));
  out.word("MAP_UPDATE");
  out.integer(message.update);
  put_id(out, message.newest);
  put_id(out, message.newest_past_probation);
  for (const auto time : kUpdateTimes) put_time(out, message.times.*time);
  out.integer(message.map.epoch);
  const PointsById by_value = by_id(message.map.points);
  const auto fresh = ids_of(message.map.points);
  out.integer(message.map.keyframes.size());
  for (const NewKeyFrame& keyframe : message.map.keyframes) {
    out.text(keyframe_text(keyframe, by_value, fresh, vocabulary, direct));
  }
  out.integer(message.poses.size());
  for (const KeyFramePose& pose : message.poses) {
    put_id(out, pose.id);
    put_pose(out, pose.T_cw);
    out.integer(pose.version);
  }
  return finish(std::move(out));
}

MapUpdate decode_update_text(std::span<const std::uint8_t> bytes, const SensorPtr& sensor,
                             DirectText* direct) {
  constexpr std::size_t kLeastKeyFrame = 100, kLeastPose = 18;
  TextReader in = open(bytes, "MAP_UPDATE", direct);
  MapUpdate message;
  message.update = static_cast<std::uint64_t>(in.integer(0, kAnyNumber));
  message.newest = get_id<KeyFrameId>(in);
  message.newest_past_probation = get_id_or_none<KeyFrameId>(in);
  for (const auto time : kUpdateTimes) message.times.*time = get_time(in);
  message.map.epoch = static_cast<std::uint64_t>(in.integer(0, kAnyNumber));
  std::set<MapPointId> seen;
  for (std::size_t n = in.count(kLeastKeyFrame); n > 0; --n) {
    take_keyframe(in.text(), sensor, message.map, seen, direct);
  }
  for (std::size_t n = in.count(kLeastPose); n > 0; --n) {
    KeyFramePose pose;
    pose.id = get_id<KeyFrameId>(in);
    pose.T_cw = get_pose(in);
    pose.version = static_cast<std::uint32_t>(in.integer(0, kAnyCount));
    message.poses.push_back(pose);
  }
  in.expect_end();
  if (message.map.keyframes.empty()) throw DecodeError("update holds no keyframe");
  return message;
}

Bytes encode_text(const FrameMessage& message, const Vocabulary& vocabulary, DirectText* direct) {
  TextWriter out(means_of(direct));
  out.word("FRAME");
  out.integer(message.frame_index);
  out.real(message.timestamp_s);
  put_features(out, message.features, vocabulary, direct);
  return finish(std::move(out));
}

FrameMessage decode_frame_text(std::span<const std::uint8_t> bytes, const SensorPtr& sensor,
                               DirectText* direct) {
  TextReader in = open(bytes, "FRAME", direct);
  if (!sensor) throw DecodeError("frame from an unknown camera");
  FrameMessage message;
  message.frame_index = static_cast<std::uint64_t>(in.integer(0, kAnyNumber));
  message.timestamp_s = in.real64();
  message.features = get_features(in, sensor, direct);
  in.expect_end();
  return message;
}

}  // namespace slambed::wire
