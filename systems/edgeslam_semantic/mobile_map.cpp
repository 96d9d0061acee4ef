// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/mobile_map.hpp"

#include <algorithm>

#include "offload/maps/update_content.hpp"

namespace slambed::edgeslam_semantic {
namespace {

/// Uploaded keyframes that must see an own point before it is uploaded: with one, the edge could
/// not determine its depth.
constexpr std::size_t kLeastObservations = 2;

LocalMapperOptions mapper_options(int neighbors) {
  LocalMapperOptions options;
  options.neighbors = options.neighbors_mono = neighbors;
  return options;
}

}  // namespace

MobileMap::MobileMap(MobileNode& node, Options options)
    : node_(node),
      options_(options),
      mapper_(mapper_options(options.neighbors), node.tracker().map(), IdSpace::kMobileMapper) {}

void MobileMap::note_own(const MapDelta& made) {
  for (const NewKeyFrame& keyframe : made.keyframes)
    own_[keyframe.id] = {keyframe.frame_index, keyframe.timestamp_s, keyframe.features};
}

void MobileMap::extend(Worker& worker, const MapDelta& made) {
  if (made.keyframes.empty()) return;
  note_own(made);
  Map& map = *node_.tracker().map();
  const KeyFrameId id = made.keyframes.back().id;
  worker.stage("insert", [&](StageUnits&) {
    mapper_.insert(id);
    return 0;
  });
  worker.stage("cull_points", [&](StageUnits&) {
    MapDelta culled = mapper_.cull_points();
    std::erase_if(culled.culled_points, [this](MapPointId p) { return known_at_edge(p); });
    map.commit(culled);
    return 0;
  });
  worker.stage("triangulate", [&](StageUnits& units) {
    const auto loose = map.read([&](const MapView& view) {
      const KeyFrame* keyframe = view.keyframe(id);
      units.n1 = static_cast<double>(keyframe->covisibles.size());
      return std::count(keyframe->points.begin(), keyframe->points.end(), MapPointId{});
    });
    units.n2 = units.n1 * static_cast<double>(loose);
    map.commit(mapper_.triangulate());
    return 0;
  });
}

bool MobileMap::known_at_edge(MapPointId point) const {
  return space_of(point) != IdSpace::kMobileMapper || sent_.contains(point) ||
         window_.points.contains(point);
}

SemanticKeyFrame MobileMap::upload(const MapDelta& made) {
  SemanticKeyFrame message;
  const KeyFrameId id = made.keyframes.back().id;
  if (!map_id_) {
    map_id_ = id;
    message.delta = made;
    for (const NewKeyFrame& keyframe : made.keyframes) uploaded_.insert(keyframe.id);
    uploads_ = static_cast<int>(made.keyframes.size());
  } else {
    node_.tracker().map()->read([&](const MapView& view) {
      const KeyFrame& keyframe = *view.keyframe(id);
      message.delta.epoch = view.epoch();
      message.delta.keyframes.push_back({.id = id,
                                         .frame_index = keyframe.frame_index,
                                         .timestamp_s = keyframe.timestamp_s,
                                         .features = keyframe.features,
                                         .T_cw = keyframe.T_cw,
                                         .points = keyframe.points,
                                         .parent = {}});
      add_points(view, message.delta.keyframes.back(), message.delta);
      return 0;
    });
    uploaded_.insert(id);
    ++uploads_;
  }
  message.map_id = map_id_;
  message.applied_slice = applied_;
  message.newest_edge_point = newest_edge_point_;
  return message;
}

SemanticKeyFrame MobileMap::upload_whole(KeyFrameId id) {
  window_ = {};
  uploaded_.clear();
  sent_.clear();
  on_movers_.clear();
  applied_ = 0;
  map_id_ = id;
  SemanticKeyFrame message;
  message.map_id = map_id_;
  message.newest_edge_point = newest_edge_point_;
  message.delta = node_.tracker().map()->read([&](const MapView& view) {
    return extract_keyframes(view, with_covisibles(view, {id}, kMostSemanticKeyFrames - 1));
  });
  for (const NewKeyFrame& keyframe : message.delta.keyframes) uploaded_.insert(keyframe.id);
  for (const NewPoint& point : message.delta.points) sent_[point.id] = id;
  uploads_ = static_cast<int>(uploaded_.size());
  return message;
}

/// Adds own points that the edge does not know yet. Clears ids of points with too few observations.
void MobileMap::add_points(const MapView& view, NewKeyFrame& keyframe, MapDelta& delta) {
  for (MapPointId& id : keyframe.points) {
    if (!id || known_at_edge(id)) continue;
    const MapPoint& point = *view.point(id);
    std::vector<ObservationEdit> earlier;
    for (const Observation& seen : point.observations)
      if (uploaded_.contains(seen.keyframe)) earlier.push_back({seen.keyframe, seen.feature, id});
    if (earlier.size() + 1 < kLeastObservations) {
      id = {};
      continue;
    }
    NewPoint fresh;
    fresh.id = id;
    fresh.p_w = point.p_w;
    fresh.reference = fresh.first_keyframe = keyframe.id;
    delta.points.push_back(fresh);
    delta.attach.insert(delta.attach.end(), earlier.begin(), earlier.end());
    sent_[id] = keyframe.id;
  }
}

bool MobileMap::apply(Worker& worker, const OptResult& result) {
  if (!map_id_ || result.map_id != map_id_ || result.number <= applied_) return false;
  worker.stage("apply_update", [&](StageUnits& units) {
    applied_ = result.number;
    for (const PointPosition& point : result.changes.positions)
      if (space_of(point.id) == IdSpace::kEdgeMapper)
        newest_edge_point_ = std::max(newest_edge_point_, point.id);
    edgeslam_semantic::apply(window_, {result.changes, result.left_keyframes, result.left_points});
    edgeslam_semantic::forget_left(own_, window_, result.keyframe);
    const auto before = node_.tracker().map();
    LocalMapParts parts{
        .window = window_, .own = own_, .newest = result.keyframe, .S_new_old = {}, .gone = {}};
    for (const auto& [id, since] : on_movers_) parts.gone.insert(id);
    for (const MapPointId id : result.changes.culled_points) parts.gone.insert(id);
    for (const PointFusion& fusion : result.changes.fusions) parts.gone.insert(fusion.gone);
    double moved = 0;
    const MapDelta local = before->read([&](const MapView& view) {
      parts.S_new_old = correction_at(view, result.keyframe, window_);
      if (const KeyFrame* rough = view.keyframe(result.keyframe))
        moved = (rough->T_cw.inverse().t - result.T_cw.inverse().t).norm();
      return local_map(view, parts);
    });
    units.n1 = static_cast<double>(local.keyframes.size());
    put(local);
    if (parts.S_new_old.scale != 1) node_.tracker().rescale(parts.S_new_old.scale);
    for (const auto& [id, observed] : window_.keyframes) node_.poses().placed(id, observed.T_cw);
    forget_left(result.keyframe);
    report(result, parts.S_new_old.scale, moved);
    return 0;
  });
  return true;
}

void MobileMap::put(const MapDelta& local) {
  auto fresh = std::make_shared<Map>();
  fresh->commit(local);
  mapper_.replace_map(fresh);
  node_.replace_map(fresh);
}

void MobileMap::keep_newest(Worker& worker) {
  while (std::ssize(uploaded_) > options_.keyframes) uploaded_.erase(uploaded_.begin());
  if (uploaded_.size() < 2) return;
  const KeyFrameId oldest = *uploaded_.begin(), before_newest = *std::prev(uploaded_.end(), 2);
  std::erase_if(own_, [&](const auto& entry) {
    return entry.first < before_newest && !uploaded_.contains(entry.first);
  });
  worker.stage("apply_update", [&](StageUnits& units) {
    put(node_.tracker().map()->read([&](const MapView& view) {
      std::vector<KeyFrameId> stay = view.keyframe_ids();
      std::erase_if(stay, [this](KeyFrameId id) { return !own_.contains(id); });
      units.n1 = static_cast<double>(stay.size());
      return extract_keyframes(view, stay);
    }));
    forget_ids(oldest);
    return 0;
  });
}

/// Keeps memory proportional to the window, not to the length of the run.
void MobileMap::forget_left(KeyFrameId newest) {
  if (window_.keyframes.empty()) return;
  std::erase_if(uploaded_,
                [&](KeyFrameId id) { return id <= newest && !window_.keyframes.contains(id); });
  forget_ids(window_.keyframes.begin()->first);
}

void MobileMap::forget_ids(KeyFrameId oldest) {
  node_.tracker().map()->read([&](const MapView& local) {
    const auto left = [&](const auto& entry) {
      return entry.second < oldest && !window_.points.contains(entry.first) &&
             !local.point(entry.first);
    };
    std::erase_if(sent_, left);
    std::erase_if(on_movers_, left);
    return 0;
  });
}

void MobileMap::report(const OptResult& result, double scale, double moved) {
  const MapDelta& changes = result.changes;
  const std::size_t points = count(*node_.tracker().map()).points;
  node_.log().write(
      JsonLine("slice_applied")
          .add("number", result.number)
          .add("keyframe", result.keyframe.value)
          .add("points_set", changes.positions.size())
          .add("points_deleted", changes.culled_points.size() + changes.fusions.size())
          .add("points_left", result.left_points.size())
          .add("keyframes_set", changes.poses.size())
          .add("edge_points", window_.points.size())
          .add("local_points", points)
          .add("kept_keyframes", own_.size())
          .add("kept_ids", uploaded_.size() + sent_.size() + on_movers_.size())
          .add("moved_m", moved)
          .add("scale", scale));
}

void MobileMap::cull(const Labels& labels) {
  Map& map = *node_.tracker().map();
  const MapDelta delta =
      map.read([&](const MapView& view) { return without_labeled(view, labels); });
  map.commit(delta);
  const KeyFrameId newest = own_.empty() ? map_id_ : own_.rbegin()->first;
  for (const MapPointId id : delta.culled_points) on_movers_[id] = newest;
}

void MobileMap::reset() {
  mapper_.replace_map(node_.tracker().map());
  window_ = {};
  own_.clear();
  uploaded_.clear();
  uploads_ = 0;
  sent_.clear();
  on_movers_.clear();
  map_id_ = {};
  applied_ = 0;
}

}  // namespace slambed::edgeslam_semantic
