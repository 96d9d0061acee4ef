// SPDX-License-Identifier: Apache-2.0
// Hypotheses for a frame's pose, the likeliest and cheapest first.
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
constexpr int kFramesWithoutMotionModel = 2;  ///< after a relocalization
constexpr float kLocalFactorRelocalized = 5;
/// A pose is doubtful if a smaller share of its matches are inliers, because wide windows find many
/// matches by chance.
constexpr float kClearShare = 0.3f;
/// Cost of comparing a point with 1,000 features, in searches of one window: 2.3 us against 0.21 us
/// (catalog/devices/host.yaml, `track`).
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
  const int inliers = search.optimize_pose(current);
  current.drop_outliers();
  return inliers >= kLeastPoseInliers;
}

/// Tracks with zero motion right after a relocalization. The keyframes that located the last frame
/// may not be references yet, while the reference shows another place.
bool Tracker::Impl::track_still() {
  if (!last.has_pose) return false;
  refresh_last();  // track_reference() may have overwritten last_points
  return track_motion(SE3());
}

bool Tracker::Impl::track_reference() {
  current.T_cw = last.T_cw;
  int matches = relocalizer.match(*map, reference, kReferenceRatio, current);
  pose_search.word_matches = matches;
  if (matches < kLeastReferenceMatches && options.descriptor_fallback) {
    // Similar descriptors can fall under different words, so this retries without words.
    copy_seen_points(*map, reference, last_points);
    matches = search.match_by_descriptor(last_points, kReferenceRatio, current);
  }
  pose_search.reference_matches = matches;
  if (matches < kLeastReferenceMatches) return false;
  const int inliers = search.optimize_pose(current);
  current.drop_outliers();
  return inliers >= kLeastPoseInliers;
}

bool Tracker::Impl::relocalize_by_appearance() {
  return relocalizer.locate(*map, reference, search, current);
}

void Tracker::Impl::note_relocalization() {
  relocalized_at = frame_number;
  relocalized_ever = true;
}

bool Tracker::Impl::track_widely() {
  local.gather_around(*map, reference);
  searched += kWideWork * static_cast<int>(local.points().size());
  return wide.locate(local.points(), search, current);
}

/// Tries hypotheses until the local map clearly agrees with one; otherwise takes the best.
bool Tracker::Impl::track_hypotheses(TrackOutcome& outcome) {
  const KeyFrameId around = reference;
  const bool relocalized = recently_relocalized(kFramesWithoutMotionModel);
  const float factor = relocalized ? kLocalFactorRelocalized : options.local_window_factor;
  last.drop_outliers();
  refresh_last();
  doubtful.reset();
  if (velocity && !relocalized) {
    const bool posed = track_motion(*velocity);
    outcome.by_motion_model = posed && verify(factor, outcome);
    if (outcome.by_motion_model) return true;
    if (posed && !options.second_hypotheses) return false;
    evidence.unpredicted = options.second_hypotheses;
  }
  reference = around;
  if (track_reference() && verify(factor, outcome)) return true;
  reference = around;
  const bool still = options.second_hypotheses || options.follow_recovery;
  if (still && relocalized && track_still() && verify(factor, outcome)) return true;
  if (!options.second_hypotheses) return false;
  reference = around;
  if (track_widely() && verify(kLocalFactorRelocalized, outcome)) return true;
  if (!doubtful) return false;
  local.begin_look();  // a doubtful pose proves nothing about points that it misses
  current = std::move(doubtful->frame);
  outcome = doubtful->outcome;
  reference = current.reference;
  return true;
}

/// Returns true if the local map clearly agrees with the pose; keeps the best doubtful one.
bool Tracker::Impl::verify(float radius_factor, TrackOutcome& outcome) {
  if (!track_local(radius_factor, outcome)) return false;
  if (!options.second_hypotheses) return true;
  if (outcome.inliers >= options.min_inliers_after_relocalization &&
      outcome.inliers >= kClearShare * static_cast<float>(outcome.matches))
    return true;
  if (!doubtful || doubtful->outcome.inliers < outcome.inliers) doubtful = {current, outcome};
  return false;
}

/// Relocalizes a lost frame by similar keyframes, then by all local points around the last
/// reference.
bool Tracker::Impl::relocalize(TrackOutcome& outcome) {
  const KeyFrameId around = reference;
  const bool located = relocalize_by_appearance();
  outcome.candidates_posed = relocalizer.candidates_posed();
  if (located) {
    note_relocalization();
    if (track_local(kLocalFactorRelocalized, outcome)) return true;
  }
  if (!options.second_hypotheses) return false;
  reference = around;
  if (!track_widely() || !verify(kLocalFactorRelocalized, outcome)) return false;
  note_relocalization();
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
  outcome.inliers = search.optimize_pose(current);
  for (std::size_t i = 0; i < current.points.size(); ++i)
    if (current.points[i] && !current.outlier[i]) local.count_found(current.points[i]);
  current.has_pose = true;
  current.reference = reference;
  current.T_cr = (current.T_cw * T_rw.inverse()).normalized();
  const bool fresh = recently_relocalized(options.max_frames_between_keyframes);
  return outcome.inliers >=
         (fresh ? options.min_inliers_after_relocalization : options.min_local_map_inliers);
}

}  // namespace slambed
