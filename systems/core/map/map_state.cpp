// SPDX-License-Identifier: Apache-2.0
#include "map/map_state.hpp"

#include <algorithm>

namespace slambed {
namespace {

/// A stereo or RGB-D observation counts twice as much as a monocular one (ORB-SLAM2's weights).
Observation observation_of(const KeyFrame& keyframe, std::uint16_t feature) {
  const KeyPoint& seen = keyframe.features->keypoint(feature);
  return {keyframe.id, feature, seen.octave, static_cast<std::uint8_t>(seen.right_u >= 0 ? 2 : 1)};
}

constexpr auto by_keyframe = [](const auto& item, KeyFrameId id) { return item.keyframe < id; };
/// Returns whether the observation counts; the keyframe must list the point (Observation::weight).
bool weighs(const KeyFrame& keyframe, const std::vector<Observation>& observations) {
  return std::lower_bound(observations.begin(), observations.end(), keyframe.id, by_keyframe)
             ->weight > 0;
}

constexpr auto by_id = [](const Covisible& item, KeyFrameId id) { return item.id < id; };

}  // namespace

const KeyFrame* MapState::keyframe(KeyFrameId id) const { return node(id); }

const MapPoint* MapState::point(MapPointId id) const {
  const PointSlot* slot = points_.find(id);
  return slot ? slot->live.get() : nullptr;
}

MapPointId MapState::resolve(MapPointId id) const {
  // A survivor was alive when the point was fused, so chains go forward in time and end.
  while (id) {
    const PointSlot* slot = points_.find(id);
    if (!slot) return {};
    if (slot->live) return id;
    id = slot->survivor;
  }
  return {};
}

std::vector<KeyFrameId> MapState::keyframe_ids() const {
  std::vector<KeyFrameId> ids;
  ids.reserve(keyframe_count_);
  keyframes_.for_each([&](const KeyFrameSlot& slot) {
    if (slot.live) ids.push_back(slot.live->id);
  });
  return ids;
}

std::vector<MapPointId> MapState::point_ids() const {
  std::vector<MapPointId> ids;
  ids.reserve(point_count_);
  points_.for_each([&](const PointSlot& slot) {
    if (slot.live) ids.push_back(slot.live->id);
  });
  return ids;
}

MapState::Node* MapState::node(KeyFrameId id) {
  KeyFrameSlot* slot = keyframes_.find(id);
  return slot ? slot->live.get() : nullptr;
}

const MapState::Node* MapState::node(KeyFrameId id) const {
  return const_cast<MapState*>(this)->node(id);
}

MapPoint* MapState::live_point(MapPointId id) {
  PointSlot* slot = points_.find(id);
  return slot ? slot->live.get() : nullptr;
}

MapState::Touch& MapState::touch(PointSlot& slot, MapPointId id) {
  if (slot.touch == 0) {
    Touch note;
    note.id = id;
    note.weight_before = slot.live->weight;
    touched_points_.push_back(note);
    slot.touch = static_cast<std::uint32_t>(touched_points_.size());
  }
  return touched_points_[slot.touch - 1];
}

void MapState::touch(Node& keyframe) {
  if (keyframe.touched) return;
  keyframe.touched = true;
  touched_keyframes_.push_back(keyframe.id);
}

void MapState::change_shared(Node& a, Node& b, int change) {
  const auto change_one = [change](Node& from, KeyFrameId to) {
    auto it = std::lower_bound(from.connected.begin(), from.connected.end(), to, by_id);
    if (it == from.connected.end() || it->id != to) it = from.connected.insert(it, {to, 0});
    it->weight += change;
    if (it->weight <= 0) from.connected.erase(it);
  };
  change_one(a, b.id);
  change_one(b, a.id);
  touch(a);
  touch(b);
}

void MapState::link(Node& keyframe, std::uint16_t feature, PointSlot& slot, MapPointId id,
                    bool counts) {
  MapPoint& point = *slot.live;
  Observation seen = observation_of(keyframe, feature);
  if (counts) {
    touch(slot, id).observations = true;
    touch(keyframe);
    for (const Observation& other : point.observations)
      if (other.weight > 0) change_shared(keyframe, *node(other.keyframe), 1);
  } else {
    seen.weight = 0;
  }
  const auto place = std::lower_bound(point.observations.begin(), point.observations.end(),
                                      keyframe.id, by_keyframe);
  point.weight += point.observations.insert(place, seen)->weight;
  keyframe.points[feature] = id;
}

void MapState::unlink(Node& keyframe, std::uint16_t feature) {
  const MapPointId id = keyframe.points[feature];
  PointSlot& slot = *points_.find(id);
  MapPoint& point = *slot.live;
  touch(slot, id).observations = true;
  keyframe.points[feature] = {};
  const auto place = std::lower_bound(point.observations.begin(), point.observations.end(),
                                      keyframe.id, by_keyframe);
  const bool counted = place->weight > 0;
  point.weight -= place->weight;
  point.observations.erase(place);
  for (const Observation& other : point.observations)
    if (counted && other.weight > 0) change_shared(keyframe, *node(other.keyframe), -1);
  if (point.reference == keyframe.id && !point.observations.empty())
    point.reference = point.observations.front().keyframe;
}

void MapState::drop_observations(MapPoint& point) {
  while (!point.observations.empty()) {
    const Observation last = point.observations.back();
    unlink(*node(last.keyframe), last.feature);
  }
}

Edit MapState::put(const NewPoint& edit) {
  PointSlot* slot = points_.make(edit.id);
  if (!slot || slot->gone) return Edit::kUnknown;
  if (!slot->live) {
    slot->live = std::make_unique<MapPoint>();
    slot->live->id = edit.id;
    ++point_count_;
    touch(*slot, edit.id).fresh = true;
  } else if (edit.version <= slot->live->version) {
    return edit.version == slot->live->version ? Edit::kNothing : Edit::kStale;
  }
  MapPoint& point = *slot->live;
  point.p_w = edit.p_w;
  if (edit.appearance.max_distance_m > 0)
    point.appearance = edit.appearance;
  else
    touch(*slot, edit.id).position = true;
  point.reference = edit.reference;
  point.first_keyframe = edit.first_keyframe;
  point.visible = std::max(point.visible, edit.visible);
  point.found = std::max(point.found, edit.found);
  point.version = edit.version;
  return Edit::kApplied;
}

Edit MapState::put(const NewKeyFrame& edit) {
  if (!edit.features || edit.points.size() != static_cast<std::size_t>(edit.features->size()))
    return Edit::kUnknown;
  if (Node* known = node(edit.id)) {
    // Only the first version adds observations; later ones arrive as attachments.
    if (edit.version == known->version) return Edit::kNothing;
    return move(KeyFramePose{edit.id, edit.T_cw, edit.version});
  }
  KeyFrameSlot* slot = keyframes_.make(edit.id);
  if (!slot || slot->tombstone) return Edit::kUnknown;
  slot->live = std::make_unique<Node>();
  Node& keyframe = *slot->live;
  keyframe.id = edit.id;
  keyframe.frame_index = edit.frame_index;
  keyframe.timestamp_s = edit.timestamp_s;
  keyframe.features = edit.features;
  keyframe.place(edit.T_cw);
  keyframe.version = edit.version;
  keyframe.points.resize(edit.points.size());
  ++keyframe_count_;
  journal_.changes.push_back(edit.id);
  if (!origin_) origin_ = edit.id;
  requested_parents_.push_back({edit.id, edit.parent});
  touch(keyframe);
  for (std::size_t feature = 0; feature < edit.points.size(); ++feature) {
    // The sender may not know of a fusion, so two features can resolve to the same point.
    const MapPointId id = resolve(edit.points[feature]);
    if (!id) continue;
    PointSlot& point = *points_.find(id);
    const auto& seen = point.live->observations;
    const auto place = std::lower_bound(seen.begin(), seen.end(), edit.id, by_keyframe);
    if (place != seen.end() && place->keyframe == edit.id) continue;
    const bool counts = edit.observes_known || point.live->first_keyframe == edit.id;
    link(keyframe, static_cast<std::uint16_t>(feature), point, id, counts);
  }
  return Edit::kApplied;
}

Edit MapState::attach(const ObservationEdit& edit) {
  Node* keyframe = node(edit.keyframe);
  PointSlot* slot = points_.find(edit.point);
  if (!keyframe || !slot || !slot->live || edit.feature >= keyframe->points.size())
    return Edit::kUnknown;
  if (keyframe->points[edit.feature] == edit.point && weighs(*keyframe, slot->live->observations))
    return Edit::kNothing;
  // The pair replaces what either side had in this keyframe, so a repeat changes nothing.
  if (keyframe->points[edit.feature]) unlink(*keyframe, edit.feature);
  const auto& seen = slot->live->observations;
  const auto place = std::lower_bound(seen.begin(), seen.end(), edit.keyframe, by_keyframe);
  if (place != seen.end() && place->keyframe == edit.keyframe) unlink(*keyframe, place->feature);
  link(*keyframe, edit.feature, *slot, edit.point);
  return Edit::kApplied;
}

Edit MapState::detach(const ObservationEdit& edit) {
  Node* keyframe = node(edit.keyframe);
  if (!keyframe || !live_point(edit.point) || edit.feature >= keyframe->points.size())
    return Edit::kUnknown;
  if (keyframe->points[edit.feature] != edit.point) return Edit::kNothing;
  unlink(*keyframe, edit.feature);
  return Edit::kApplied;
}

Edit MapState::fuse(const PointFusion& edit) {
  PointSlot* gone = points_.find(edit.gone);
  const MapPointId survivor_id = resolve(edit.survivor);
  if (!gone || !gone->live || !survivor_id) return Edit::kUnknown;
  if (survivor_id == edit.gone) return Edit::kNothing;
  PointSlot& survivor = *points_.find(survivor_id);
  const std::vector<Observation> moving = gone->live->observations;
  for (const Observation& seen : moving) {
    Node& keyframe = *node(seen.keyframe);
    unlink(keyframe, seen.feature);
    const auto& has = survivor.live->observations;
    const auto place = std::lower_bound(has.begin(), has.end(), seen.keyframe, by_keyframe);
    if (place == has.end() || place->keyframe != seen.keyframe)
      link(keyframe, seen.feature, survivor, survivor_id, seen.weight > 0);
  }
  survivor.live->visible += gone->live->visible;
  survivor.live->found += gone->live->found;
  gone->live.reset();
  gone->gone = true;
  gone->survivor = survivor_id;
  --point_count_;
  return Edit::kApplied;
}

Edit MapState::move(const PointPosition& edit) {
  PointSlot* slot = points_.find(edit.id);
  if (!slot || !slot->live) return Edit::kUnknown;
  MapPoint& point = *slot->live;
  if (edit.version == point.version && edit.p_w == point.p_w) return Edit::kNothing;
  if (edit.version <= point.version) return Edit::kStale;
  point.p_w = edit.p_w;
  point.version = edit.version;
  touch(*slot, edit.id).position = true;
  return Edit::kApplied;
}

Edit MapState::move(const KeyFramePose& edit) {
  Node* keyframe = node(edit.id);
  if (!keyframe) return Edit::kUnknown;
  if (edit.version == keyframe->version && edit.T_cw.R == keyframe->T_cw.R &&
      edit.T_cw.t == keyframe->T_cw.t)
    return Edit::kNothing;
  if (edit.version <= keyframe->version) return Edit::kStale;
  keyframe->place(edit.T_cw);
  keyframe->version = edit.version;
  return Edit::kApplied;
}

Edit MapState::count(const PointObservationCounts& edit) {
  MapPoint* point = live_point(edit.id);
  if (!point) return Edit::kUnknown;
  // Counters only grow, so the larger value is the newer one.
  if (edit.visible <= point->visible && edit.found <= point->found) return Edit::kNothing;
  point->visible = std::max(point->visible, edit.visible);
  point->found = std::max(point->found, edit.found);
  return Edit::kApplied;
}

Edit MapState::cull(MapPointId id) {
  PointSlot* slot = points_.find(id);
  if (!slot || !slot->live) return Edit::kUnknown;
  drop_observations(*slot->live);
  slot->live.reset();
  slot->gone = true;
  --point_count_;
  return Edit::kApplied;
}

void MapState::clear() {
  keyframes_.clear();
  points_.clear();
  keyframe_count_ = point_count_ = 0;
  origin_ = {};
  epoch_ = 0;
  journal_ = {};
  touched_points_ = {};
  touched_keyframes_ = {};
  requested_parents_ = {};
}

}  // namespace slambed
