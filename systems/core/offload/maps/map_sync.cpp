// SPDX-License-Identifier: Apache-2.0
#include "offload/maps/map_sync.hpp"

#include <algorithm>
#include <unordered_map>
#include <unordered_set>

#include "map/map_snapshot.hpp"

namespace slambed {
namespace {

/// Finds elements of a list by id. Never iterated, so the hash order does not matter.
template <typename Element>
class ById {
 public:
  explicit ById(const std::vector<Element>& list) {
    for (const Element& element : list) places_.emplace(element.id, &element);
  }
  template <typename IdType>
  const Element* find(IdType id) const {
    const auto place = places_.find(id);
    return place == places_.end() ? nullptr : place->second;
  }

 private:
  std::unordered_map<decltype(Element::id), const Element*> places_;
};

void add_observation_changes(const NewKeyFrame& before, const NewKeyFrame& now, MapDelta& delta) {
  for (std::size_t i = 0; i < now.points.size() && i < before.points.size(); ++i) {
    if (now.points[i] == before.points[i]) continue;
    const auto feature = static_cast<std::uint16_t>(i);
    // An attachment replaces the point that was attached before.
    if (now.points[i]) {
      delta.attach.push_back({now.id, feature, now.points[i]});
    } else {
      delta.detach.push_back({now.id, feature, before.points[i]});
    }
  }
}

/// Adds the pose and the missing observations of a keyframe that the map already has.
void add_to_known(const MapView& map, const KeyFrame& known, const NewKeyFrame& keyframe,
                  MapDelta& rebased) {
  rebased.poses.push_back({keyframe.id, keyframe.T_cw, known.version + 1});
  for (std::size_t i = 0; i < keyframe.points.size() && i < known.points.size(); ++i) {
    const MapPointId id = map.resolve(keyframe.points[i]);
    const MapPointId point = id ? id : keyframe.points[i];  // may be a new point of these changes
    if (!point || known.points[i] == point) continue;
    rebased.attach.push_back({keyframe.id, static_cast<std::uint16_t>(i), point});
  }
}

}  // namespace

MapCopy copy_of(const Map& map, const MapDelta& earlier) {
  return map.read([&](const MapView& view) {
    MapCopy copy{.whole = snapshot(view), .gone = {}};
    for (const NewPoint& point : earlier.points) {
      if (view.point(point.id)) continue;
      if (const MapPointId survivor = view.resolve(point.id)) {
        copy.gone.fusions.push_back({point.id, survivor});
      } else {
        copy.gone.culled_points.push_back(point.id);
      }
    }
    for (const NewKeyFrame& keyframe : earlier.keyframes) {
      if (!view.keyframe(keyframe.id)) copy.gone.culled_keyframes.push_back(keyframe.id);
    }
    return copy;
  });
}

MapDelta changes_since(const MapDelta& earlier, const MapCopy& later) {
  MapDelta since = later.gone;
  const ById keyframes_before(earlier.keyframes);
  const ById points_before(earlier.points);
  for (const NewKeyFrame& keyframe : later.whole.keyframes) {
    const NewKeyFrame* before = keyframes_before.find(keyframe.id);
    if (!before) {
      since.keyframes.push_back(keyframe);
      continue;
    }
    if (keyframe.version != before->version)
      since.poses.push_back({keyframe.id, keyframe.T_cw, keyframe.version});
    add_observation_changes(*before, keyframe, since);
  }
  for (const NewPoint& point : later.whole.points) {
    const NewPoint* before = points_before.find(point.id);
    if (!before) {
      since.points.push_back(point);
    } else if (point.version != before->version) {
      since.positions.push_back({point.id, point.p_w, point.version});
    }
  }
  return since;
}

MapDelta rebase_changes(const MapView& map, const MapDelta& changes) {
  MapDelta rebased;
  rebased.epoch = changes.epoch;
  for (const NewPoint& point : changes.points) {
    if (const MapPoint* known = map.point(point.id)) {
      rebased.positions.push_back({point.id, point.p_w, known->version + 1});
    } else {
      rebased.points.push_back(point);
    }
  }
  for (const NewKeyFrame& keyframe : changes.keyframes) {
    if (const KeyFrame* known = map.keyframe(keyframe.id)) {
      add_to_known(map, *known, keyframe, rebased);
      continue;
    }
    if (map.pose_of(keyframe.id)) continue;  // was culled
    rebased.keyframes.push_back(keyframe);
    if (!map.keyframe(keyframe.parent)) {
      const bool comes_too =
          std::any_of(changes.keyframes.begin(), changes.keyframes.end(),
                      [&](const NewKeyFrame& other) { return other.id == keyframe.parent; });
      if (!comes_too) rebased.keyframes.back().parent = {};
    }
  }
  std::unordered_set<KeyFrameId> added;
  for (const NewKeyFrame& keyframe : rebased.keyframes) added.insert(keyframe.id);
  for (ObservationEdit edit : changes.attach) {
    if (!map.keyframe(edit.keyframe) && !added.contains(edit.keyframe)) continue;  // was culled
    if (const MapPointId id = map.resolve(edit.point)) edit.point = id;
    rebased.attach.push_back(edit);
  }
  rebased.detach = changes.detach;
  rebased.fusions = changes.fusions;
  for (PointPosition position : changes.positions) {
    const MapPoint* known = map.point(position.id);
    if (!known) continue;
    position.version = known->version + 1;
    rebased.positions.push_back(position);
  }
  for (KeyFramePose pose : changes.poses) {
    const KeyFrame* known = map.keyframe(pose.id);
    if (!known) continue;
    pose.version = known->version + 1;
    rebased.poses.push_back(pose);
  }
  rebased.culled_points = changes.culled_points;
  rebased.culled_keyframes = changes.culled_keyframes;

  std::unordered_set<MapPointId> seen;
  for (const NewKeyFrame& keyframe : rebased.keyframes)
    seen.insert(keyframe.points.begin(), keyframe.points.end());
  for (const ObservationEdit& edit : rebased.attach) seen.insert(edit.point);
  std::erase_if(rebased.points, [&](const NewPoint& point) { return !seen.contains(point.id); });
  return rebased;
}

}  // namespace slambed
