// SPDX-License-Identifier: Apache-2.0
#include "slam/tracker.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "slam/frame_search.hpp"
#include "slam/keyframe_maker.hpp"
#include "slam/keyframe_rule.hpp"
#include "slam/local_view.hpp"
#include "slam/map_change.hpp"
#include "slam/relocaliser.hpp"
#include "slam/two_view_start.hpp"

namespace slambed {
namespace {

// ORB-SLAM2's limits of tracking.
constexpr int kLeastMotionMatches = 20;
constexpr int kLeastReferenceMatches = 15;
constexpr int kLeastPoseInliers = 10;
constexpr float kReferenceRatio = 0.7f;
constexpr int kFramesWithoutMotionModel = 2;  ///< after a relocalisation
constexpr float kLocalFactorRelocalised = 5;
/// A first keyframe with fewer points than this could not be tracked in the next frame anyway.
constexpr int kLeastInitPoints = 50;

}  // namespace

struct Tracker::Impl {
  Impl(TrackerOptions o, std::shared_ptr<Map> m, IdSpace space, std::shared_ptr<PlaceIndex> places)
      : options(o), map(std::move(m)), ids(space), relocaliser(std::move(places)) {
    find_in_foreign_map();
  }

  TrackOutcome track(std::uint64_t index, double time_s, std::shared_ptr<const FeatureSet> set);
  void initialise(TrackOutcome& outcome);
  std::optional<MapDelta> first_keyframe();
  void refresh_last();
  bool track_motion();
  bool track_reference();
  bool relocalise();
  bool track_local(TrackOutcome& outcome);
  void gather_evidence(int inliers);
  void start_over();
  void find_in_foreign_map();
  MapDelta create_keyframe(bool becomes_reference);
  void continue_on(std::shared_ptr<Map> fresh);

  bool recently_relocalised(int frames) const {
    return relocalised_ever && frame_number - relocalised_at < frames;
  }

  TrackerOptions options;
  std::shared_ptr<Map> map;
  TrackerIds ids;
  TrackingState state = TrackingState::kNotInitialised;

  Frame current, last;
  std::optional<SE3> velocity;          ///< T_current_last of the last two frames
  KeyFrameId reference;                 ///< keyframe that poses are relative to
  std::vector<KeyFrameId> provisional;  ///< created here but not (yet) fit to be a reference
  int frame_number = 0;                 ///< frames processed; starts at 1
  int keyframe_at = 0, relocalised_at = 0;
  bool relocalised_ever = false;
  KeyFrameEvidence evidence;
  MapDelta first_delta;  ///< of the keyframes made by initialise()
  bool first_delta_waiting = false;

  LocalView local;
  FrameSearch search;
  Relocaliser relocaliser;
  TwoViewStart two_views;
  std::vector<SeenPoint> last_points;
};

TrackOutcome Tracker::Impl::track(std::uint64_t index, double time_s,
                                  std::shared_ptr<const FeatureSet> set) {
  std::swap(current, last);
  current.begin(index, time_s, std::move(set));
  ++frame_number;
  evidence = {};
  first_delta = {};
  first_delta_waiting = false;
  TrackOutcome outcome;

  if (state == TrackingState::kNotInitialised) {
    initialise(outcome);
  } else {
    bool posed = false;
    if (state == TrackingState::kOk) {
      last.drop_outliers();
      refresh_last();
      if (velocity && !recently_relocalised(kFramesWithoutMotionModel)) posed = track_motion();
      outcome.by_motion_model = posed;
      if (!posed) posed = track_reference();
    } else {
      posed = relocalise();
    }
    const bool tracked = posed && track_local(outcome);
    if (tracked) {
      velocity =
          last.has_pose ? std::optional<SE3>(current.T_cw * last.T_cw.inverse()) : std::nullopt;
      state = TrackingState::kOk;
      gather_evidence(outcome.inliers);
    } else {
      state = TrackingState::kLost;
      velocity.reset();
      outcome.by_motion_model = false;
      current.clear_matches();
      current.has_pose = false;
      const auto keyframes =
          map->read([](const MapView& view) { return static_cast<int>(view.keyframe_count()); });
      if (keyframes < options.reset_below_keyframes) {
        start_over();
        outcome.reset_now = true;
      }
    }
  }
  outcome.state = state;
  if (state == TrackingState::kOk) {
    outcome.T_cw = current.T_cw;
    outcome.reference = current.reference;
    outcome.T_cr = current.T_cr;
  }
  return outcome;
}

/// With depth one frame is enough for a map.
std::optional<MapDelta> Tracker::Impl::first_keyframe() {
  const auto keypoints = current.features->keypoints();
  const auto with_depth = std::count_if(keypoints.begin(), keypoints.end(),
                                        [](const KeyPoint& p) { return p.has_depth(); });
  if (with_depth < kLeastInitPoints) return std::nullopt;
  current.T_cw = SE3();
  return make_keyframe(*map, current, current.T_cw, NewPoints::kAllWithDepth, ids);
}

void Tracker::Impl::initialise(TrackOutcome& outcome) {
  if (current.features->size() <= options.min_init_features) {
    two_views.reset();
    return;
  }
  auto made = current.features->sensor().metric() ? first_keyframe() : two_views.offer(current, ids);
  if (!made) return;
  first_delta = std::move(*made);
  first_delta_waiting = true;
  map->commit(first_delta);
  reference = first_delta.keyframes.back().id;
  current.has_pose = true;
  current.reference = reference;
  current.T_cr = SE3();
  keyframe_at = frame_number;
  velocity.reset();
  state = TrackingState::kOk;
  outcome.initialised_now = true;
  outcome.matches = outcome.inliers = outcome.local_points =
      static_cast<int>(first_delta.points.size());
  evidence.tracked = true;
}

/// Brings the last frame up to date with the map: its pose follows its reference keyframe, fused
/// points are replaced by their survivors, points that are gone are forgotten.
void Tracker::Impl::refresh_last() {
  last_points.clear();
  map->read([&](const MapView& view) {
    if (last.has_pose)
      if (const auto T_rw = view.pose_of(last.reference)) last.T_cw = last.T_cr * *T_rw;
    for (std::size_t i = 0; i < last.points.size(); ++i) {
      if (!last.points[i]) continue;
      last.points[i] = view.resolve(last.points[i]);
      const MapPoint* point = view.point(last.points[i]);
      if (!point) continue;
      const KeyPoint& seen = last.features->keypoint(static_cast<int>(i));
      last_points.push_back(
          {point->id, point->p_w, point->appearance.descriptor, seen.angle_deg, seen.octave, 0, 0});
    }
    return 0;
  });
}

bool Tracker::Impl::track_motion() {
  const SE3 predicted = (*velocity * last.T_cw).normalized();
  current.T_cw = predicted;
  int matches = search.match_last_frame(last_points, last.T_cw, options.motion_window_px, current);
  if (matches < kLeastMotionMatches)
    matches =
        search.match_last_frame(last_points, last.T_cw, 2 * options.motion_window_px, current);
  if (matches < kLeastMotionMatches) return false;
  const int inliers = search.optimise_pose(current);
  current.drop_outliers();
  return inliers >= kLeastPoseInliers;
}

bool Tracker::Impl::track_reference() {
  current.T_cw = last.T_cw;
  if (relocaliser.match(*map, reference, kReferenceRatio, current) < kLeastReferenceMatches) {
    // Words can part what belongs together: once more without them.
    copy_seen_points(*map, reference, last_points);
    if (search.match_by_descriptor(last_points, kReferenceRatio, current) < kLeastReferenceMatches)
      return false;
  }
  const int inliers = search.optimise_pose(current);
  current.drop_outliers();
  return inliers >= kLeastPoseInliers;
}

bool Tracker::Impl::relocalise() {
  if (!relocaliser.locate(*map, reference, search, current)) return false;
  relocalised_at = frame_number;
  relocalised_ever = true;
  return true;
}

bool Tracker::Impl::track_local(TrackOutcome& outcome) {
  const auto update = local.update(*map, current, [&](KeyFrameId id) {
    return !std::binary_search(provisional.begin(), provisional.end(), id);
  });
  SE3 T_rw = update.T_rw;
  if (update.reference) {
    reference = update.reference;
  } else {
    const auto known = map->read([&](const MapView& view) { return view.pose_of(reference); });
    if (!known) return false;
    T_rw = *known;
  }
  const float factor = recently_relocalised(kFramesWithoutMotionModel)
                           ? kLocalFactorRelocalised
                           : options.local_window_factor;
  search.add_local(local, factor, static_cast<std::uint32_t>(frame_number), current);
  outcome.local_points = static_cast<int>(local.points().size());
  outcome.matches = current.matches();
  outcome.inliers = search.optimise_pose(current);
  for (std::size_t i = 0; i < current.points.size(); ++i)
    if (current.points[i] && !current.outlier[i]) local.count_found(current.points[i]);
  current.has_pose = true;
  current.reference = reference;
  current.T_cr = (current.T_cw * T_rw.inverse()).normalized();
  const bool fresh = recently_relocalised(options.max_frames_between_keyframes);
  return outcome.inliers >=
         (fresh ? options.min_inliers_after_relocalisation : options.min_local_map_inliers);
}

void Tracker::Impl::gather_evidence(int inliers) {
  evidence.tracked = true;
  evidence.frames_since_keyframe = frame_number - keyframe_at;
  evidence.frames_since_relocalisation = frame_number - relocalised_at;
  evidence.relocalised_ever = relocalised_ever;
  evidence.inliers = inliers;
  map->read([&](const MapView& view) {
    evidence.keyframes = static_cast<int>(view.keyframe_count());
    const KeyFrame* keyframe = view.keyframe(reference);
    if (!keyframe) return 0;
    const int least = least_reference_weight(evidence.keyframes);
    for (const MapPointId id : keyframe->points)
      if (id && view.point(id)->weight >= least) ++evidence.reference_matches;
    return 0;
  });
  const float close_m = current.features->sensor().close_depth_m;
  for (int i = 0; i < current.features->size(); ++i) {
    const KeyPoint& seen = current.features->keypoint(i);
    if (!seen.has_depth() || seen.depth_m >= close_m) continue;
    if (current.points[i] && !current.outlier[i])
      ++evidence.close_tracked;
    else
      ++evidence.close_untracked;
  }
}

void Tracker::Impl::start_over() {
  map->clear();
  local.clear();
  two_views.reset();
  provisional.clear();
  reference = {};
  velocity.reset();
  relocalised_ever = false;
  state = TrackingState::kNotInitialised;
}

/// A map that was made elsewhere: find the place in it, and name nothing as it does.
void Tracker::Impl::find_in_foreign_map() {
  map->read([&](const MapView& view) {
    if (view.keyframe_count() > 0) state = TrackingState::kLost;
    for (const KeyFrameId id : view.keyframe_ids()) ids.keyframes.skip(id);
    for (const MapPointId id : view.point_ids()) ids.points.skip(id);
    return 0;
  });
}

MapDelta Tracker::Impl::create_keyframe(bool becomes_reference) {
  if (first_delta_waiting) {
    first_delta_waiting = false;
    return std::exchange(first_delta, {});
  }
  if (state != TrackingState::kOk || !current.has_pose) return {};
  // The map may have been corrected since the frame was tracked.
  if (const auto T_rw =
          map->read([&](const MapView& view) { return view.pose_of(current.reference); }))
    current.T_cw = current.T_cr * *T_rw;
  MapDelta delta = make_keyframe(*map, current, current.T_cw, NewPoints::kCloseOrNearest, ids);
  delta.sightings = local.take_sightings(*map);
  map->commit(delta);
  const KeyFrameId id = delta.keyframes[0].id;
  if (becomes_reference) {
    reference = current.reference = id;
    current.T_cr = SE3();
  } else {
    provisional.push_back(id);
  }
  keyframe_at = frame_number;
  return delta;
}

void Tracker::Impl::continue_on(std::shared_ptr<Map> fresh) {
  const MapChange change =
      compare_maps(*map, *fresh, current.reference ? current.reference : reference);
  rename_points(*map, *fresh, current.points);
  map = std::move(fresh);
  local.clear();
  provisional.clear();
  first_delta_waiting = false;
  if (state == TrackingState::kNotInitialised) find_in_foreign_map();
  if (!change.reference) {
    start_over();
    return;
  }
  reference = change.reference;
  if (current.has_pose) {
    current.T_cw = current.T_cw * change.T_old_new;
    current.reference = reference;
    current.T_cr = current.T_cw * change.T_rw.inverse();
  }
}

Tracker::Tracker(TrackerOptions options, std::shared_ptr<Map> map, IdSpace space,
                 std::shared_ptr<PlaceIndex> places)
    : impl_(std::make_unique<Impl>(options, std::move(map), space, std::move(places))) {}
Tracker::~Tracker() = default;

TrackOutcome Tracker::track(std::uint64_t frame_index, double timestamp_s,
                            std::shared_ptr<const FeatureSet> features) {
  return impl_->track(frame_index, timestamp_s, std::move(features));
}

KeyFrameNeed Tracker::keyframe_need() const {
  if (impl_->first_delta_waiting) return KeyFrameNeed::kUrgent;
  return slambed::keyframe_need(impl_->options, impl_->evidence);
}

bool Tracker::wants_keyframe(const MapperStatus& mapper) const {
  if (impl_->first_delta_waiting) return true;
  return slambed::wants_keyframe(impl_->options, impl_->evidence, mapper);
}

MapDelta Tracker::create_keyframe(bool becomes_reference) {
  return impl_->create_keyframe(becomes_reference);
}

void Tracker::accept_keyframes() { impl_->provisional.clear(); }
void Tracker::replace_map(std::shared_ptr<Map> map) { impl_->continue_on(std::move(map)); }
std::shared_ptr<Map> Tracker::map() const { return impl_->map; }
TrackingState Tracker::state() const { return impl_->state; }

}  // namespace slambed
