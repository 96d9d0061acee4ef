// SPDX-License-Identifier: Apache-2.0
// The ways to a frame's pose, from the likeliest and cheapest on.
#include <algorithm>
#include <utility>

#include "slam/tracker_impl.hpp"

namespace slambed {
namespace {

// ORB-SLAM2's limits of tracking.
constexpr int kLeastMotionMatches = 20;
constexpr int kLeastReferenceMatches = 15;
constexpr int kLeastPoseInliers = 10;
constexpr float kReferenceRatio = 0.7f;
constexpr int kFramesWithoutMotionModel = 2;  ///< after a relocalisation
constexpr float kLocalFactorRelocalised = 5;
/// A pose is doubtful when fewer of its matches than this agree with it: wide windows find enough
/// by chance.
constexpr float kClearShare = 0.3f;
/// What comparing a point with all of 1,000 features costs, in searches of a point in its window:
/// 2.3 us against 0.21 us (catalog/devices/host.yaml, `track`).
constexpr int kWideWork = 11;

}  // namespace

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

bool Tracker::Impl::track_motion(const SE3& step) {
  const SE3 predicted = (step * last.T_cw).normalized();
  current.T_cw = predicted;
  int matches = search.match_last_frame(last_points, last.T_cw, options.motion_window_px, current);
  if (matches < kLeastMotionMatches)
    matches =
        search.match_last_frame(last_points, last.T_cw, 2 * options.motion_window_px, current);
  pose_search.motion_matches = matches;
  if (matches < kLeastMotionMatches) return false;
  const int inliers = search.optimise_pose(current);
  current.drop_outliers();
  return inliers >= kLeastPoseInliers;
}

/// Found a frame ago, perhaps by keyframes that the edge may still decline: these are no reference,
/// and the one there is may be of another place. What was seen then is still in view.
bool Tracker::Impl::track_still() {
  if (!last.has_pose) return false;
  refresh_last();  // its points made way for the reference keyframe's
  return track_motion(SE3());
}

bool Tracker::Impl::track_reference() {
  current.T_cw = last.T_cw;
  int matches = relocaliser.match(*map, reference, kReferenceRatio, current);
  pose_search.word_matches = matches;
  if (matches < kLeastReferenceMatches && options.descriptor_fallback) {
    // Words can part what belongs together: once more without them.
    copy_seen_points(*map, reference, last_points);
    matches = search.match_by_descriptor(last_points, kReferenceRatio, current);
  }
  pose_search.reference_matches = matches;
  if (matches < kLeastReferenceMatches) return false;
  const int inliers = search.optimise_pose(current);
  current.drop_outliers();
  return inliers >= kLeastPoseInliers;
}

bool Tracker::Impl::relocalise() { return relocaliser.locate(*map, reference, search, current); }

void Tracker::Impl::note_relocalisation() {
  relocalised_at = frame_number;
  relocalised_ever = true;
}

bool Tracker::Impl::track_widely() {
  local.gather_around(*map, reference);
  searched += kWideWork * static_cast<int>(local.points().size());
  return wide.locate(local.points(), search, current);
}

/// One hypothesis after the other until the local map clearly agrees with one; else the best.
bool Tracker::Impl::follow(TrackOutcome& outcome) {
  const KeyFrameId around = reference;
  const bool relocalised = recently_relocalised(kFramesWithoutMotionModel);
  const float factor = relocalised ? kLocalFactorRelocalised : options.local_window_factor;
  last.drop_outliers();
  refresh_last();
  doubtful.reset();
  if (velocity && !relocalised) {
    const bool posed = track_motion(*velocity);
    outcome.by_motion_model = posed && agrees(factor, outcome);
    if (outcome.by_motion_model) return true;
    if (posed && !options.second_hypotheses) return false;
    evidence.unpredicted = options.second_hypotheses;
  }
  reference = around;
  if (track_reference() && agrees(factor, outcome)) return true;
  reference = around;
  const bool still = options.second_hypotheses || options.follow_recovery;
  if (still && relocalised && track_still() && agrees(factor, outcome)) return true;
  if (!options.second_hypotheses) return false;
  reference = around;
  if (track_widely() && agrees(kLocalFactorRelocalised, outcome)) return true;
  if (!doubtful) return false;
  local.begin_look();  // what a doubtful pose should see and does not says nothing
  current = std::move(doubtful->frame);
  outcome = doubtful->outcome;
  reference = current.reference;
  return true;
}

/// Whether the local map clearly agrees with the pose. One that it may be right with is put by.
bool Tracker::Impl::agrees(float radius_factor, TrackOutcome& outcome) {
  if (!track_local(radius_factor, outcome)) return false;
  if (!options.second_hypotheses) return true;
  if (outcome.inliers >= options.min_inliers_after_relocalisation &&
      outcome.inliers >= kClearShare * static_cast<float>(outcome.matches))
    return true;
  if (!doubtful || doubtful->outcome.inliers < outcome.inliers) doubtful = {current, outcome};
  return false;
}

bool Tracker::Impl::find_again(TrackOutcome& outcome) {
  const KeyFrameId around = reference;
  const bool located = relocalise();
  outcome.candidates_posed = relocaliser.candidates_posed();
  if (located) {
    note_relocalisation();
    if (track_local(kLocalFactorRelocalised, outcome)) return true;
  }
  if (!options.second_hypotheses) return false;
  reference = around;
  if (!track_widely() || !agrees(kLocalFactorRelocalised, outcome)) return false;
  note_relocalisation();
  return true;
}

bool Tracker::Impl::track_local(float radius_factor, TrackOutcome& outcome) {
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
  search.add_local(local, radius_factor, current);
  outcome.local_points = static_cast<int>(local.points().size());
  searched += outcome.local_points;
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

}  // namespace slambed
