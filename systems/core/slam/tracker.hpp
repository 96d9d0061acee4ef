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

/// ORB-SLAM2's constants; frames counted at the played rate.
struct TrackerOptions {
  int min_init_features = 500;
  int max_frames_between_keyframes = 30;  ///< ORB-SLAM2's mMaxFrames ...
  bool max_frames_is_a_second = true;     ///< ... a node sets it to a second at the played rate
  int min_frames_between_keyframes = 0;
  int min_local_map_inliers = 30;
  int min_inliers_after_relocalization = 50;
  float motion_window_px = 15;
  float local_window_factor = 3;    ///< of the windows in which local points are looked for
  int close_points_wanted = 100;    ///< needClose: fewer tracked than this ...
  int close_points_available = 70;  ///< ... and more untracked than this
  float reference_ratio = 0.75f;
  float urgent_ratio = 0.25f;     ///< of the reference's points; fewer: not to be put off
  int busy_queue = 3;             ///< fewer keyframes than this may wait for a busy mapper
  int reset_below_keyframes = 6;  ///< lost with fewer keyframes: start over
  /// Without a map too: it will come from elsewhere (Tracker::replace_map). False: the first frames
  /// make one.
  bool begins_lost = false;
  /// Where the camera moved far between two frames: doubts poses that few matches agree with, tries
  /// every other hypothesis, at last all local points without a prediction. False: ORB-SLAM2's
  /// steps alone, which lose such frames.
  bool second_hypotheses = true;
  /// Of these the one for the frames right after a recovery, also without the others: where only
  /// keyframes that an edge may still decline see the place, none of it is the reference.
  bool follow_recovery = false;
  // What Edge-SLAM's code does without; see edgeslam/system.yaml.
  bool descriptor_fallback = true;    ///< too few matches by words: once more by descriptors alone
  bool points_by_observation = true;  ///< fused points are found again in a map that is replaced
  bool points_by_rank = false;        ///< in a new map points of the last frame change places
  bool newest_is_reference = false;   ///< of a new map, not the old reference where it is known
  bool reanchor_last = true;          ///< in a new map the last pose moves with its reference
  /// Its keyframes count as observations of points that were known before; false: only mapping does
  /// that, elsewhere.
  bool observes_known = true;
};

/// What ORB-SLAM2 does differently with this sensor; the options are those for RGB-D.
TrackerOptions suited(TrackerOptions options, SensorKind sensor);

/// How a frame's pose was looked for. Matches of each way that was tried; nothing: it was not.
struct PoseSearch {
  std::optional<int>
      motion_matches;               ///< the last frame's points where the motion model expects them
  std::optional<int> word_matches;  ///< the reference keyframe's points, by words of the vocabulary
  /// The reference keyframe's points, also by descriptors alone where words found too few.
  std::optional<int> reference_matches;
};

struct TrackOutcome {
  TrackingState state = TrackingState::kNotInitialized;
  bool initialized_now = false;  ///< this frame became the first keyframe (mono: the second)
  bool reset_now = false;        ///< map was thrown away (lost too early)
  SE3 T_cw;                      ///< valid when state is kOk
  KeyFrameId reference;          ///< keyframe the pose is relative to
  SE3 T_cr;                      ///< camera from reference keyframe
  int matches = 0;               ///< after the local-map search
  int inliers = 0;               ///< after the last pose optimization
  int local_points = 0;
  /// Points looked for over all hypotheses, as many as the work is worth: what the frame cost.
  int searched_points = 0;
  /// Of a lost frame: keyframes whose matches gave a pose, right or not.
  int candidates_posed = 0;
  bool by_motion_model = false;
  PoseSearch search;
  bool resumed = false;  ///< lost until now, and tracked from a frame that was found elsewhere
};

/// A lost frame that somebody else has found: its pose, and which of its features is which point.
struct FoundFrame {
  std::uint64_t index = 0;
  double timestamp_s = 0;
  std::shared_ptr<const FeatureSet> features;
  SE3 T_cw;
  KeyFrameId reference;            ///< in the tracker's map
  std::vector<MapPointId> points;  ///< per feature; none where unmatched
};

/// What the keyframe decision asks of the mapper's side.
struct MapperStatus {
  bool idle = true;
  int queued = 0;
  bool accepts = true;  ///< false while stopped or parked
};

/// Outcome of ORB-SLAM2's rule, cut as Edge-SLAM cuts it.
enum class KeyFrameNeed {
  kNone,
  kIfMapperAgrees,  ///< c2 only: needs c1a (time) or c1b (mapper idle)
  kUrgent,          ///< c2 and c1c: few inliers or close points wanted
};

/// Tracks one camera against a map. A plain module: knows no thread, clock, socket or file.
class Tracker {
 public:
  /// A map with keyframes in it: the tracker starts lost there, and its ids go on behind the map's.
  /// places: to find lost frames again with; without one the tracker keeps its own.
  Tracker(TrackerOptions options, std::shared_ptr<Map> map, IdSpace ids,
          std::shared_ptr<PlaceIndex> places = nullptr);
  ~Tracker();

  TrackOutcome track(std::uint64_t frame_index, double timestamp_s,
                     std::shared_ptr<const FeatureSet> features);

  /// Makes the first keyframe at this pose, not the identity, also after a reset: the map then
  /// shares its world frame with another one (CloudSLAM's alignment). Without effect once there is
  /// a map, and for a single camera, whose first map has a scale of its own.
  void start_at(const SE3& T_cw);
  /// Goes on from a pose that somebody else found for a lost frame (relocalization by pose): the
  /// next frame is tracked from this keyframe as right after a relocalization. False, and nothing
  /// changed, when the tracker is not lost or its map has no such keyframe.
  bool continue_from(const SE3& T_cw, KeyFrameId reference);
  /// The same with the frame that was found, which may be older than the last one tracked: it takes
  /// the last one's place, without a velocity. Tracking stays lost until a frame was tracked from
  /// it; the next one is tried so first, then as any lost frame.
  bool continue_from(const FoundFrame& found);

  /// What the keyframe rule knows of the frame just tracked, for rules of one's own.
  const KeyFrameEvidence& evidence() const;
  /// The rule for the frame just tracked, without what the mapper's side knows.
  KeyFrameNeed keyframe_need() const;
  /// The whole ORB-SLAM2 decision with a mapper in the same node.
  bool wants_keyframe(const MapperStatus& mapper) const;
  /// Makes a keyframe (and points for its unmatched close features) of the frame just tracked,
  /// commits it to the map and returns the committed delta. The first keyframe (a single camera
  /// starts with two) comes the same way: track() has committed it already, the next call hands its
  /// delta out. Empty without a pose.
  /// becomes_reference false: not a reference either until the map is replaced (Edge-SLAM's
  /// keyframes that the edge has yet to accept).
  MapDelta create_keyframe(bool becomes_reference = true);
  /// Keyframes that were not to be references (yet) may be from now on: mapping has come here.
  void accept_keyframes();

  /// Continues on another map (Edge-SLAM's update): point ids of the last frame are looked up in
  /// it, the last pose is re-expressed through the reference keyframe when that is known there.
  /// provisional (ascending): keyframes of it that are still not to be references.
  void replace_map(std::shared_ptr<Map> map, std::span<const KeyFrameId> provisional = {});
  /// The part of the map around the last frame was moved: p_new = T_new_old * p_old. Between that
  /// frame and the next, after the change was committed; T_rw_before: where the last frame's
  /// reference keyframe was until then. The motion model stays as it is.
  void moved(const SE3& T_new_old, const SE3& T_rw_before);
  /// All distances of the map were multiplied by this: right after replace_map, so that the last
  /// pose and the motion model are of the same scale.
  void rescale(double factor);
  /// The keyframe that the last pose is relative to.
  KeyFrameId reference() const;
  std::shared_ptr<Map> map() const;
  TrackingState state() const;
  /// Whether the next frame will be looked for among all places, having no other to go on from.
  bool searches_whole_map() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace slambed
