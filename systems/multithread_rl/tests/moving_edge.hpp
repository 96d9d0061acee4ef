// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <memory>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "multithread_rl/tests/staging_scenario.hpp"
#include "offload/maps/map_sync.hpp"
#include "offload/maps/update_content.hpp"
#include "slam/tests/synthetic_scene.hpp"

namespace slambed::testing {

/// An edge that keeps all keyframes of a mobile in its own world, which moves as a whole and in
/// which points are fused and culled. Makes updates and locates lost frames.
class MovingEdge {
 public:
  struct Update {
    std::uint64_t number = 0;
    MapDelta map;
    KeyFrameId newest;
    SE3 T_world;  ///< maps the initial world to the update's
  };
  struct Found {
    std::shared_ptr<const FeatureSet> features;
    SE3 T_cw;
    std::vector<MapPointId> points;  ///< per feature
    MapDelta keyframe;               ///< whole
    double degrees;                  ///< where the camera is
  };

  /// Receives a keyframe of the mobile. things: what its features show; degrees: where it was made.
  void receive(const MapDelta& made, const std::vector<int>& things, double degrees) {
    MapDelta here = made;
    const SE3 T_edge_mobile = T_world_ * T_mobile_.inverse();
    for (NewPoint& point : here.points) {
      point.p_w = T_edge_mobile * point.p_w;
      point.appearance.normal = T_edge_mobile.R.cast<float>() * point.appearance.normal;
    }
    for (NewKeyFrame& keyframe : here.keyframes) {
      keyframe.T_cw = (keyframe.T_cw * T_edge_mobile.inverse()).normalized();
      std::set<MapPointId> seen;
      map_.read([&](const MapView& view) {
        for (MapPointId& id : keyframe.points) {
          const bool comes_too = std::any_of(here.points.begin(), here.points.end(),
                                             [&](const NewPoint& point) { return point.id == id; });
          if (id && !comes_too) id = view.resolve(id);
          if (id && !seen.insert(id).second) id = {};
        }
        return 0;
      });
      made_[keyframe.id] = {things, degrees};
      if (recovered_at_) since_recovery_ = std::min(since_recovery_, keyframe.id);
    }
    here.observation_counts.clear();
    map_.commit(here);
  }

  /// RESUME: updates also carry this keyframe until one is full of keyframes made after it.
  void recovered(KeyFrameId reference) {
    recovered_at_ = reference;
    since_recovery_ = kNone;
  }

  /// Moves the whole world.
  void correct(std::mt19937& random) {
    const SE3 T_new_old = small_motion(random, 0.5);
    MapDelta delta = map_.read([&](const MapView& view) {
      MapDelta moved;
      for (const KeyFrameId id : view.keyframe_ids()) {
        const KeyFrame* keyframe = view.keyframe(id);
        moved.poses.push_back(
            {id, (keyframe->T_cw * T_new_old.inverse()).normalized(), keyframe->version + 1});
      }
      for (const MapPointId id : view.point_ids()) {
        const MapPoint* point = view.point(id);
        moved.positions.push_back({id, T_new_old * point->p_w, point->version + 1});
      }
      return moved;
    });
    map_.commit(delta);
    T_world_ = (T_new_old * T_world_).normalized();
  }

  /// Makes an update without the newest 0 to 2 keyframes; some of its points are fused or culled.
  Update update(std::mt19937& random, std::size_t count) {
    std::vector<KeyFrameId> ids =
        map_.read([](const MapView& view) { return view.keyframe_ids(); });
    ids.resize(ids.size() - std::min<std::size_t>(random() % 3, ids.size() - 1));
    if (ids.size() > count) ids.erase(ids.begin(), ids.end() - static_cast<std::ptrdiff_t>(count));
    const auto mapped =
        std::count_if(ids.begin(), ids.end(), [&](KeyFrameId id) { return id >= since_recovery_; });
    const KeyFrameId newest = ids.back();
    if (std::cmp_greater_equal(mapped, count)) recovered_at_ = {};
    if (recovered_at_ && std::find(ids.begin(), ids.end(), recovered_at_) == ids.end())
      ids.push_back(recovered_at_);
    merge_points(random, ids);
    return {.number = next_number(),
            .map = map_.read([&](const MapView& view) { return extract_keyframes(view, ids); }),
            .newest = newest,
            .T_world = T_world_};
  }

  /// Makes a frame near one of its keyframes, with the points that this keyframe knows.
  Found find(std::mt19937& random, SyntheticScene& scene, const std::function<SE3(double)>& pose_at,
             int features) {
    auto known = made_.begin();
    std::advance(known, random() % made_.size());
    const auto& [reference, made] = *known;
    Found found;
    found.degrees = made.degrees + 1;
    found.features = scene.look(pose_at(found.degrees), {}, features);
    const std::vector<int>& things = scene.seen();
    found.points.resize(things.size());
    map_.read([&](const MapView& view) {
      const KeyFrame* keyframe = view.keyframe(reference);
      const SE3 T_frame_keyframe = pose_at(found.degrees) * pose_at(made.degrees).inverse();
      found.T_cw = (T_frame_keyframe * keyframe->T_cw).normalized();
      found.keyframe = extract_keyframes(view, std::array{reference});
      for (std::size_t i = 0; i < things.size(); ++i) {
        const auto at = std::find(made.things.begin(), made.things.end(), things[i]);
        if (at != made.things.end())
          found.points[i] = keyframe->points[static_cast<std::size_t>(at - made.things.begin())];
      }
      return 0;
    });
    return found;
  }

  std::uint64_t next_number() { return ++number_; }
  /// Returns whether the world has moved since the state that the mobile's map has.
  bool has_moved() const { return (T_world_.inverse() * T_mobile_).log().norm() > 1e-6; }
  void mobile_has_its_world() { T_mobile_ = T_world_; }
  void mobile_has(const Update& update) { T_mobile_ = update.T_world; }
  /// Maps the mobile's world to the update's.
  SE3 moved_since(const Update& update) const { return update.T_world * T_mobile_.inverse(); }

 private:
  struct Made {
    std::vector<int> things;
    double degrees = 0;
  };

  void merge_points(std::mt19937& random, const std::vector<KeyFrameId>& keyframes) {
    MapDelta delta = map_.read([&](const MapView& view) {
      MapDelta merged;
      for (const NewPoint& point : extract_keyframes(view, keyframes).points) {
        if (random() % 8 != 0 || space_of(point.id) == IdSpace::kEdgeMapper) continue;
        if (random() % 2 == 0) {
          merged.culled_points.push_back(point.id);
          continue;
        }
        NewPoint survivor = point;
        survivor.id = StagingScenario::survivor_of(point.id);
        merged.points.push_back(survivor);
        merged.fusions.push_back({point.id, survivor.id});
      }
      return merged;
    });
    map_.commit(delta);
  }

  static constexpr KeyFrameId kNone{~std::uint64_t{0}};

  Map map_;
  std::map<KeyFrameId, Made> made_;
  KeyFrameId recovered_at_, since_recovery_ = kNone;
  std::uint64_t number_ = 0;
  SE3 T_world_, T_mobile_;  ///< map the initial world to the edge's and to the mobile's
};

}  // namespace slambed::testing
