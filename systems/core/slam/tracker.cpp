// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <utility>
#include <vector>

#include "slam/keyframe_rule.hpp"
#include "slam/map_change.hpp"
#include "slam/tracker_impl.hpp"

namespace slambed {
namespace {

/// A first keyframe with fewer points than this could not be tracked in the next frame anyway.
constexpr int kLeastInitPoints = 50;

}  // namespace

TrackOutcome Tracker::Impl::track(std::uint64_t index, double time_s,
                                  std::shared_ptr<const FeatureSet> set) {
  std::swap(current, last);
  current.begin(index, time_s, std::move(set));
  ++frame_number;
  evidence = {};
  searched = 0;
  pose_search = {};
  first_delta = {};
  first_delta_waiting = false;
  TrackOutcome outcome;

  if (state == TrackingState::kNotInitialized) {
    initialize(outcome);
  } else {
    const KeyFrameId before = reference;
    const bool tracked = state == TrackingState::kOk
                             ? track_hypotheses(outcome)
                             : track_from_found_frame(outcome) || relocalize(outcome);
    if (tracked) {
      local.keep_observation_counts();
      velocity =
          last.has_pose ? std::optional<SE3>(current.T_cw * last.T_cw.inverse()) : std::nullopt;
      state = TrackingState::kOk;
      gather_evidence(outcome.inliers);
    } else {
      state = TrackingState::kLost;
      velocity.reset();
      reference = before;
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
  outcome.searched_points = searched;
  outcome.search = pose_search;
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
  current.T_cw = first_T_cw;
  return make_keyframe(*map, current, current.T_cw, NewPoints::kAllWithDepth, ids);
}

void Tracker::Impl::initialize(TrackOutcome& outcome) {
  if (current.features->size() <= options.min_init_features) {
    two_views.reset();
    return;
  }
  auto made =
      current.features->sensor().metric() ? first_keyframe() : two_views.offer(current, ids);
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
  outcome.initialized_now = true;
  outcome.matches = outcome.inliers = outcome.local_points =
      static_cast<int>(first_delta.points.size());
  evidence.tracked = true;
}

void Tracker::Impl::gather_evidence(int inliers) {
  evidence.tracked = true;
  evidence.metric = current.features->sensor().metric();
  evidence.frames_since_keyframe = frame_number - keyframe_at;
  evidence.frames_since_relocalization = frame_number - relocalized_at;
  evidence.relocalized_ever = relocalized_ever;
  evidence.inliers = inliers;
  map->read([&](const MapView& view) {
    evidence.keyframes = static_cast<int>(view.keyframe_count());
    const KeyFrame* keyframe = view.keyframe(reference);
    if (!keyframe) return 0;
    const int least = least_reference_weight(evidence);
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
  relocalized_ever = false;
  found_elsewhere = false;
  state = TrackingState::kNotInitialized;
}

/// Starts lost in a map that was made elsewhere, and reserves the ids that it uses.
void Tracker::Impl::relocalize_in_received_map() {
  map->read([&](const MapView& view) {
    if (view.keyframe_count() > 0) state = TrackingState::kLost;
    for (const KeyFrameId id : view.keyframe_ids()) ids.keyframes.skip(id);
    for (const MapPointId id : view.point_ids()) ids.points.skip(id);
    return 0;
  });
}

bool Tracker::Impl::continue_from(const SE3& T_cw, KeyFrameId at) {
  if (state != TrackingState::kLost) return false;
  const auto T_rw = map->read([&](const MapView& view) {
    const KeyFrame* keyframe = view.keyframe(at);
    return keyframe ? std::optional<SE3>(keyframe->T_cw) : std::nullopt;
  });
  if (!T_rw) return false;
  current.clear_matches();
  current.has_pose = true;
  current.T_cw = T_cw;
  reference = current.reference = at;
  current.T_cr = (T_cw * T_rw->inverse()).normalized();
  velocity.reset();
  evidence = {};
  note_relocalization();
  state = TrackingState::kOk;
  return true;
}

bool Tracker::Impl::continue_from(const FoundFrame& found) {
  if (state != TrackingState::kLost) return false;
  const auto T_rw = map->read([&](const MapView& view) {
    const KeyFrame* keyframe = view.keyframe(found.reference);
    return keyframe ? std::optional<SE3>(keyframe->T_cw) : std::nullopt;
  });
  if (!T_rw || std::ssize(found.points) != found.features->size()) return false;
  current.begin(found.index, found.timestamp_s, found.features);
  current.points = found.points;
  current.has_pose = true;
  current.T_cw = found.T_cw;
  reference = current.reference = found.reference;
  current.T_cr = (found.T_cw * T_rw->inverse()).normalized();
  velocity.reset();
  note_relocalization();
  found_elsewhere = true;
  return true;
}

/// Tracks a lost frame from the previous one if that was relocalized elsewhere.
bool Tracker::Impl::track_from_found_frame(TrackOutcome& outcome) {
  if (!std::exchange(found_elsewhere, false)) return false;
  const KeyFrameId before = reference;
  outcome.resumed = track_hypotheses(outcome);
  last.has_pose = false;  // too far back for a velocity
  if (outcome.resumed) return true;
  outcome = {};
  reference = before;
  current.clear_matches();
  current.has_pose = false;
  return false;
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
  delta.observation_counts = local.take_observation_counts(*map);
  delta.keyframes[0].observes_known = options.observes_known;
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

void Tracker::Impl::continue_on(std::shared_ptr<Map> fresh,
                                std::span<const KeyFrameId> still_provisional) {
  const MapChange change =
      compare_maps(*map, *fresh, current.reference ? current.reference : reference,
                   {.newest_is_reference = options.newest_is_reference,
                    .only_from_newest = !options.reanchor_last});
  if (options.points_by_rank) {
    current.drop_outliers();
    hand_out_by_rank(current.points);
  }
  if (options.points_by_observation)
    rename_points(*map, *fresh, current.points);
  else
    keep_tracked_points(*fresh, current.points);
  map = std::move(fresh);
  local.clear();
  provisional.assign(still_provisional.begin(), still_provisional.end());
  first_delta_waiting = false;
  if (!reference) relocalize_in_received_map();  // no frame was tracked in the old map
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

void Tracker::start_at(const SE3& T_cw) { impl_->first_T_cw = T_cw; }
bool Tracker::continue_from(const SE3& T_cw, KeyFrameId reference) {
  return impl_->continue_from(T_cw, reference);
}
bool Tracker::continue_from(const FoundFrame& found) { return impl_->continue_from(found); }
const KeyFrameEvidence& Tracker::evidence() const { return impl_->evidence; }

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

void Tracker::moved(const SE3& T_new_old, const SE3& T_rw_before) {
  Frame& frame = impl_->current;
  if (!frame.has_pose) return;
  const auto T_rw =
      impl_->map->read([&](const MapView& view) { return view.pose_of(frame.reference); });
  if (!T_rw) return;
  // The reference may have moved by less than what the frame sees.
  frame.T_cw = (frame.T_cr * T_rw_before * T_new_old.inverse()).normalized();
  frame.T_cr = (frame.T_cw * T_rw->inverse()).normalized();
}

void Tracker::rescale(double factor) {
  if (impl_->velocity) impl_->velocity->t *= factor;
  Frame& frame = impl_->current;
  if (!frame.has_pose) return;
  const auto T_rw =
      impl_->map->read([&](const MapView& view) { return view.pose_of(frame.reference); });
  if (!T_rw) return;
  frame.T_cr.t *= factor;
  frame.T_cw = (frame.T_cr * *T_rw).normalized();
}

KeyFrameId Tracker::reference() const {
  return impl_->current.has_pose ? impl_->current.reference : KeyFrameId{};
}

void Tracker::accept_keyframes() { impl_->provisional.clear(); }
void Tracker::replace_map(std::shared_ptr<Map> map, std::span<const KeyFrameId> provisional) {
  impl_->continue_on(std::move(map), provisional);
}
std::shared_ptr<Map> Tracker::map() const { return impl_->map; }
TrackingState Tracker::state() const { return impl_->state; }
bool Tracker::searches_whole_map() const {
  return impl_->state == TrackingState::kLost && !impl_->found_elsewhere;
}

}  // namespace slambed
