// SPDX-License-Identifier: Apache-2.0
#include "slam/local_mapper.hpp"

#include <optional>
#include <utility>
#include <vector>

#include "slam/bundle_window.hpp"
#include "slam/keyframe_culling.hpp"
#include "slam/point_merging.hpp"
#include "slam/point_triangulation.hpp"

namespace slambed {
namespace {

// ORB-SLAM2's MapPointCulling: a new point must be found in at least a quarter of the frames that
// should see it. From the second keyframe after its own its weight must exceed three (mono: two, as
// an observation weighs one). After the third it stays.
constexpr double kLeastFoundShare = 0.25;
constexpr int kMinAgeForObserverTest = 2;  ///< keyframes
constexpr int kLeastWeight = 3, kLeastWeightMono = 2;

}  // namespace

struct LocalMapper::Impl {
  Impl(LocalMapperOptions o, std::shared_ptr<Map> m, IdSpace ids) : options(o), point_ids(ids) {
    work_on(std::move(m));
  }
  void work_on(std::shared_ptr<Map> other);

  struct Recent {
    MapPointId id;
    int since = 0;  ///< number of the keyframe it came with
  };

  int age_of(const Recent& one, const MapPoint& point) const {
    return options.ages_by_id ? static_cast<int>(current.value - point.first_keyframe.value)
                              : keyframes - one.since;
  }

  LocalMapperOptions options;
  std::shared_ptr<Map> map;
  IdSource<MapPointId> point_ids;
  KeyFrameId current;
  int neighbors = 0;     ///< of the current keyframe that are used
  int least_weight = 0;  ///< a recent point must exceed it
  int keyframes = 0;     ///< inserted so far
  std::vector<Recent> recent;
  PointTriangulation triangulation;
  PointMerging merging;
  BundleWindow::Scratch window_scratch;
  BundleLimits limits;
  std::optional<BundleWindow> window;
};

/// Switches to a map and reserves the point ids that it uses.
void LocalMapper::Impl::work_on(std::shared_ptr<Map> other) {
  map = std::move(other);
  map->read([&](const MapView& view) {
    for (const MapPointId id : view.point_ids()) point_ids.skip(id);
    return 0;
  });
}

LocalMapper::LocalMapper(LocalMapperOptions options, std::shared_ptr<Map> map, IdSpace ids)
    : impl_(std::make_unique<Impl>(options, std::move(map), ids)) {}
LocalMapper::~LocalMapper() = default;

void LocalMapper::insert(KeyFrameId keyframe) {
  impl_->current = keyframe;
  impl_->window.reset();
  ++impl_->keyframes;
  impl_->map->read([&](const MapView& view) {
    const KeyFrame* added = view.keyframe(keyframe);
    if (!added) return 0;
    const Sensor& sensor = added->features->sensor();
    impl_->neighbors = impl_->options.neighbors_for(sensor);
    impl_->least_weight = sensor.metric() ? kLeastWeight : kLeastWeightMono;
    for (const MapPointId id : added->points)
      if (id && view.point(id)->first_keyframe == keyframe)
        impl_->recent.push_back({id, impl_->keyframes});
    return 0;
  });
}

MapDelta LocalMapper::cull_points() {
  MapDelta delta;
  impl_->map->read([&](const MapView& view) {
    delta.epoch = view.epoch();
    std::erase_if(impl_->recent, [&](const Impl::Recent& recent) {
      const MapPoint* point = view.point(recent.id);
      if (!point) return true;
      const int age = impl_->age_of(recent, *point);
      const bool hardly_found = point->found < kLeastFoundShare * point->visible;
      const bool hardly_seen =
          age >= kMinAgeForObserverTest && point->weight <= impl_->least_weight;
      if (hardly_found || hardly_seen) {
        delta.culled_points.push_back(recent.id);
        return true;
      }
      return age >= kProbationKeyFrames;
    });
    return 0;
  });
  return delta;
}

MapDelta LocalMapper::triangulate() {
  MapDelta delta =
      impl_->triangulation.run(*impl_->map, impl_->current, impl_->neighbors, impl_->point_ids);
  for (const NewPoint& point : delta.points) impl_->recent.push_back({point.id, impl_->keyframes});
  return delta;
}

MapDelta LocalMapper::fuse() {
  return impl_->merging.run(*impl_->map, impl_->current, impl_->neighbors,
                            impl_->options.second_neighbors);
}

bool LocalMapper::begin_bundle() {
  BundleLimits limits = impl_->limits;
  limits.size = impl_->options.bundle_size;
  impl_->window = BundleWindow::around(*impl_->map, impl_->current, impl_->options.bundle,
                                       impl_->window_scratch, limits);
  return impl_->window.has_value();
}

bool LocalMapper::step_bundle() { return impl_->window && impl_->window->step(); }

std::size_t LocalMapper::bundle_observations() const {
  return impl_->window ? impl_->window->observations() : 0;
}

MapDelta LocalMapper::finish_bundle() {
  if (!impl_->window) return {};
  MapDelta delta = impl_->window->result();
  impl_->window.reset();
  return delta;
}

MapDelta LocalMapper::cull_keyframes() {
  return redundant_keyframes(*impl_->map, impl_->current, impl_->options.redundant_share);
}

void LocalMapper::replace_map(std::shared_ptr<Map> map) {
  impl_->work_on(std::move(map));
  impl_->current = {};
  impl_->recent.clear();
  impl_->window.reset();
  impl_->limits = {};
}

void LocalMapper::limit_bundles(const BundleLimits& limits) { impl_->limits = limits; }

void LocalMapper::skip(MapPointId used) { impl_->point_ids.skip(used); }

}  // namespace slambed
