// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/ids.hpp"
#include "features/feature_set.hpp"
#include "geometry/se3.hpp"
#include "map/map.hpp"
#include "slam/keyframe_evidence.hpp"

namespace slambed {

class PlaceIndex;

enum class TrackingState { kNotInitialized, kOk, kLost };

/// ORB-SLAM2's constants. Counts of frames refer to the played rate.
struct TrackerOptions {
  int min_init_features = 500;
  int max_frames_between_keyframes = 30;  ///< ORB-SLAM2's mMaxFrames
  bool max_frames_is_a_second = true;  ///< a node sets mMaxFrames to one second at the played rate
  int min_frames_between_keyframes = 0;
  int min_local_map_inliers = 30;
  int min_inliers_after_relocalization = 50;
  float motion_window_px = 15;
  float local_window_factor = 3;    ///< scales the search windows of local map points
  int close_points_wanted = 100;    ///< bNeedToInsertClose: fewer close points tracked ...
  int close_points_available = 70;  ///< ... and more untracked than this
  float reference_ratio = 0.75f;
  float urgent_ratio = 0.25f;  ///< c1c: urgent below this share of the reference's points
  int busy_queue = 3;          ///< a busy mapper takes keyframes while fewer than this are queued
  int reset_below_keyframes = 6;  ///< tracking loss with fewer keyframes than this resets the map
  /// Starts lost even with an empty map, because the map will come through Tracker::replace_map.
  /// False: the first frames make the map.
  bool begins_lost = false;
  /// For large motion between frames: if few matches support a pose, tries every other hypothesis,
  /// and last all local points without a prediction. False: only ORB-SLAM2's steps, which lose such
  /// frames.
  bool second_hypotheses = true;
  /// Enables one of these hypotheses, zero motion right after a recovery, even without the others.
  /// Needed if only keyframes that the edge may still decline see the place, because none of them
  /// is the reference.
  bool follow_recovery = false;
  // Edge-SLAM's code does the opposite of these defaults; see edgeslam/system.yaml.
  bool descriptor_fallback = true;  ///< retries by descriptors alone if words give too few matches
  bool points_by_observation = true;  ///< finds fused points again in a new map (rename_points)
  bool points_by_rank = false;  ///< permutes last frame's points in a new map (hand_out_by_rank)
  bool newest_is_reference = false;  ///< in a new map, even if it has the old reference
  bool reanchor_last = true;         ///< in a new map the last pose moves with its reference
  /// New keyframes count as observations of points that already existed. False: only the mapper, on
  /// the other node, adds these observations.
  bool observes_known = true;
};

/// Adapts options for RGB-D to this sensor, as ORB-SLAM2 does.
TrackerOptions suited(TrackerOptions options, SensorKind sensor);

/// Numbers of matches of the searches for a frame's pose; nothing for a search that was not tried.
struct PoseSearch {
  std::optional<int> motion_matches;  ///< last frame's points, predicted by the motion model
  std::optional<int> word_matches;    ///< reference keyframe's points, by vocabulary words
  /// The reference keyframe's points, also by descriptors alone where words found too few.
  std::optional<int> reference_matches;
};

struct TrackOutcome {
  TrackingState state = TrackingState::kNotInitialized;
  bool initialized_now = false;  ///< this frame became the first keyframe (mono: the second)
  bool reset_now = false;        ///< the map was discarded (lost too early)
  SE3 T_cw;                      ///< valid when state is kOk
  KeyFrameId reference;          ///< keyframe that the pose is relative to
  SE3 T_cr;                      ///< camera from reference keyframe
  int matches = 0;               ///< after the local-map search
  int inliers = 0;               ///< after the last pose optimization
  int local_points = 0;
  /// Points searched for over all hypotheses, weighted by their cost.
  int searched_points = 0;
  /// For a lost frame: keyframes whose matches gave a pose, correct or not.
  int candidates_posed = 0;
  bool by_motion_model = false;
  PoseSearch search;
  bool resumed = false;  ///< was lost, now tracked from a FoundFrame
};

/// A lost frame that was relocalized elsewhere, with its pose and matched points.
struct FoundFrame {
  std::uint64_t index = 0;
  double timestamp_s = 0;
  std::shared_ptr<const FeatureSet> features;
  SE3 T_cw;
  KeyFrameId reference;            ///< in the tracker's map
  std::vector<MapPointId> points;  ///< per feature; none where unmatched
};

/// State of the mapper, for the keyframe decision.
struct MapperStatus {
  bool idle = true;
  int queued = 0;
  bool accepts = true;  ///< false while stopped or parked
};

/// Outcome of ORB-SLAM2's keyframe rule before the mapper's conditions, as Edge-SLAM splits it.
enum class KeyFrameNeed {
  kNone,
  kIfMapperAgrees,  ///< c2 only: needs c1a (time) or c1b (mapper idle)
  kUrgent,          ///< c2 and c1c: few inliers or close points wanted
};

/// Tracks one camera against a map. Uses no thread, clock, socket or file.
class Tracker {
 public:
  /// Starts lost if the map already has keyframes; new ids continue after the map's. places: index
  /// for relocalization; null: the tracker makes its own.
  Tracker(TrackerOptions options, std::shared_ptr<Map> map, IdSpace ids,
          std::shared_ptr<PlaceIndex> places = nullptr);
  ~Tracker();

  TrackOutcome track(std::uint64_t frame_index, double timestamp_s,
                     std::shared_ptr<const FeatureSet> features);

  /// Places the first keyframe at this pose instead of the identity, also after a reset. The map
  /// then shares its world frame with another one (CloudSLAM's alignment). Has no effect once a map
  /// exists, or with a monocular camera, whose map has its own scale.
  void start_at(const SE3& T_cw);
  /// Resumes from a pose that was found elsewhere for a lost frame (relocalization by pose). The
  /// next frame is tracked from this keyframe as right after a relocalization. Returns false and
  /// changes nothing if the tracker is not lost or its map lacks the keyframe.
  bool continue_from(const SE3& T_cw, KeyFrameId reference);
  /// The same with the frame itself, which may be older than the last one tracked; it replaces that
  /// one, without a velocity. The state stays lost until a frame is tracked from it. The next frame
  /// tries this first and is then relocalized like any lost frame.
  bool continue_from(const FoundFrame& found);

  /// Input of the keyframe rule for the frame just tracked; systems may apply their own rule to it.
  const KeyFrameEvidence& evidence() const;
  /// Keyframe rule for the frame just tracked, without the conditions on the mapper.
  KeyFrameNeed keyframe_need() const;
  /// ORB-SLAM2's complete decision, for a mapper on the same node.
  bool wants_keyframe(const MapperStatus& mapper) const;
  /// Makes a keyframe of the frame just tracked, with points for its unmatched close features,
  /// commits it and returns the delta. Returns an empty delta if the frame has no pose. track()
  /// commits the first keyframe (mono: the first two) itself; the next call only returns its delta.
  /// becomes_reference false: the keyframe is no reference until accept_keyframes() or
  /// replace_map() (Edge-SLAM's keyframes that the edge has yet to accept).
  MapDelta create_keyframe(bool becomes_reference = true);
  /// Allows all keyframes as references from now on, because mapping has moved to this node.
  void accept_keyframes();

  /// Continues on another map (Edge-SLAM's update). Looks up the last frame's points in it and
  /// re-expresses the last pose through the reference keyframe if the new map has it. provisional
  /// (ascending): keyframes of the new map that must not be references yet.
  void replace_map(std::shared_ptr<Map> map, std::span<const KeyFrameId> provisional = {});
  /// Moves the last pose after a correction of the map around it: p_new = T_new_old * p_old. Call
  /// it between two frames, after the correction was committed. T_rw_before is the last frame's
  /// reference pose before the correction. The motion model stays as it is.
  void moved(const SE3& T_new_old, const SE3& T_rw_before);
  /// Scales the last pose and the motion model after all distances of the map were multiplied by
  /// the factor. Call it right after replace_map.
  void rescale(double factor);
  /// The keyframe that the last pose is relative to.
  KeyFrameId reference() const;
  std::shared_ptr<Map> map() const;
  TrackingState state() const;
  /// True if the next frame will be relocalized in the whole map: the tracker is lost and has no
  /// FoundFrame to continue from.
  bool searches_whole_map() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace slambed
