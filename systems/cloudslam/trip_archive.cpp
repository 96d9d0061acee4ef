// SPDX-License-Identifier: Apache-2.0
#include "cloudslam/trip_archive.hpp"

#include <unordered_set>

#include "node/messaging.hpp"
#include "slam/loop_closer.hpp"
#include "store/map_file.hpp"
#include "wire/message_type.hpp"
#include "wire/trip_messages.hpp"

namespace slambed {
namespace {

/// Returns all keyframes and points that the archive lacks, as one change.
MapDelta missing(const MapView& view, std::span<const MapDelta> trip) {
  MapDelta delta;
  delta.epoch = view.epoch();
  std::unordered_set<KeyFrameId> keyframes;
  for (const MapDelta& one : trip)
    for (const NewKeyFrame& keyframe : one.keyframes)
      if (!view.keyframe(keyframe.id)) keyframes.insert(keyframe.id);
  std::unordered_set<MapPointId> points;
  for (const MapDelta& one : trip) {
    if (one.keyframes.empty() || !keyframes.contains(one.keyframes.front().id)) continue;
    NewKeyFrame keyframe = one.keyframes.front();
    for (const NewPoint& point : one.points) {
      if (view.resolve(point.id) || !points.insert(point.id).second) continue;
      NewPoint fresh = point;
      if (!keyframes.contains(fresh.reference) && !view.keyframe(fresh.reference))
        fresh.reference = keyframe.id;
      if (!keyframes.contains(fresh.first_keyframe) && !view.keyframe(fresh.first_keyframe))
        fresh.first_keyframe = fresh.reference;
      delta.points.push_back(fresh);
    }
    std::unordered_set<MapPointId> seen;
    for (MapPointId& id : keyframe.points) {
      const MapPointId known = id ? view.resolve(id) : MapPointId{};
      if (known) id = known;
      if (id && (!(known || points.contains(id)) || !seen.insert(id).second)) id = {};
    }
    keyframe.parent = {};
    delta.keyframes.push_back(std::move(keyframe));
  }
  return delta;
}

}  // namespace

JoinedTrip join_trip(Map& archive, const std::shared_ptr<PlaceIndex>& places,
                     std::span<const MapDelta> trip) {
  JoinedTrip joined;
  const MapDelta delta = archive.read([&](const MapView& view) { return missing(view, trip); });
  joined.keyframes = delta.keyframes.size();
  archive.commit(delta);
  // LoopCloser shares ownership of its map; the caller owns this one and outlives the closer.
  const std::shared_ptr<Map> map(&archive, [](Map*) {});
  LoopCloser closer({}, map, places);
  for (const NewKeyFrame& keyframe : delta.keyframes) {
    if (!closer.detect(keyframe.id) || !closer.verify()) continue;
    const MapDelta correction = closer.correct();
    archive.commit(correction);
    if (!correction.empty()) ++joined.loops;
    if (!closer.begin_graph()) continue;
    while (closer.step_graph()) {
    }
    archive.commit(closer.finish_graph());
  }
  if (joined.keyframes > 0 && closer.begin_bundle()) {
    while (closer.step_bundle()) {
    }
    archive.commit(closer.finish_bundle());
    joined.adjusted = true;
  }
  return joined;
}

void TripUpload::start() {
  node_.runtime().spawn("upload", [this](Worker& worker) { receive(worker); });
}

void TripUpload::receive(Worker& worker) {
  while (const auto message = channel_.receive(worker, kNever)) {
    if (is(*message, wire::kKeyFrame)) {
      on_keyframe(worker, *message);
    } else if (is(*message, wire::kTripUpload)) {
      whole_ = true;
      send(channel_, wire::kTripUpload);
    }
  }
}

void TripUpload::on_keyframe(Worker& worker, const Message& raw) {
  worker.stage(codec_.parse_stage(), [&](StageUnits& units) {
    auto keyframe = read(node_.log(), raw, [&](const Bytes& filled) {
      const auto own = wire::without_filler(filled);
      const Bytes bytes(own.begin(), own.end());
      units.n1 = kilobytes(bytes);
      return codec_.keyframe(worker, bytes, node_.peer().sensor());
    });
    if (keyframe) keyframes_[keyframe->keyframe] = std::move(keyframe->delta);
  });
}

void TripUpload::leave(Map& archive, const std::shared_ptr<PlaceIndex>& places, const MapInfo& info,
                       const std::filesystem::path& folder) {
  if (!whole_) {
    node_.log().warning("the trip was not uploaded whole; no cloud_map.slm");
    return;
  }
  std::vector<MapDelta> trip;
  for (auto& [id, delta] : keyframes_) trip.push_back(std::move(delta));
  const JoinedTrip joined = join_trip(archive, places, trip);
  const MapCounts counts = count(archive);
  node_.log().write(JsonLine("trip_joined")
                        .add("uploaded", joined.keyframes)
                        .add("loops", joined.loops)
                        .add("adjusted", joined.adjusted)
                        .add("keyframes", counts.keyframes)
                        .add("points", counts.points));
  save_map(archive, info, folder / "cloud_map.slm");
}

}  // namespace slambed
