// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "slam/frame_search.hpp"
#include "slam/keyframe_maker.hpp"
#include "slam/local_view.hpp"
#include "slam/relocalizer.hpp"
#include "slam/tracker.hpp"
#include "slam/two_view_start.hpp"
#include "slam/wide_search.hpp"

namespace slambed {

/// Internals of a tracker: the life of a frame (tracker.cpp) and the hypotheses for its pose
/// (tracker_hypotheses.cpp).
struct Tracker::Impl {
  Impl(TrackerOptions o, std::shared_ptr<Map> m, IdSpace space, std::shared_ptr<PlaceIndex> places)
      : options(o), map(std::move(m)), ids(space), relocalizer(std::move(places)) {
    relocalize_in_received_map();
    if (options.begins_lost) state = TrackingState::kLost;
  }

  TrackOutcome track(std::uint64_t index, double time_s, std::shared_ptr<const FeatureSet> set);
  void initialize(TrackOutcome& outcome);
  std::optional<MapDelta> first_keyframe();
  void refresh_last();
  bool track_motion(const SE3& step);
  bool track_still();
  bool track_reference();
  bool track_widely();
  bool relocalize_by_appearance();
  void note_relocalization();
  bool track_hypotheses(TrackOutcome& outcome);
  bool verify(float radius_factor, TrackOutcome& outcome);
  bool relocalize(TrackOutcome& outcome);
  bool track_local(float radius_factor, TrackOutcome& outcome);
  void gather_evidence(int inliers);
  void start_over();
  void relocalize_in_received_map();
  bool continue_from(const SE3& T_cw, KeyFrameId at);
  bool continue_from(const FoundFrame& found);
  bool track_from_found_frame(TrackOutcome& outcome);
  MapDelta create_keyframe(bool becomes_reference);
  void continue_on(std::shared_ptr<Map> fresh, std::span<const KeyFrameId> still_provisional);

  bool recently_relocalized(int frames) const {
    return relocalized_ever && frame_number - relocalized_at < frames;
  }

  TrackerOptions options;
  std::shared_ptr<Map> map;
  TrackerIds ids;
  TrackingState state = TrackingState::kNotInitialized;
  SE3 first_T_cw;  ///< of the first keyframe of a map

  Frame current, last;
  std::optional<SE3> velocity;          ///< T_current_last of the last two frames
  KeyFrameId reference;                 ///< keyframe that poses are relative to
  std::vector<KeyFrameId> provisional;  ///< must not be references yet; ascending
  int frame_number = 0;                 ///< frames processed; starts at 1
  int keyframe_at = 0, relocalized_at = 0;
  bool relocalized_ever = false;
  bool found_elsewhere = false;  ///< last is a FoundFrame
  KeyFrameEvidence evidence;
  int searched = 0;        ///< points searched for in this frame, weighted by cost
  PoseSearch pose_search;  ///< of this frame
  MapDelta first_delta;    ///< of the keyframes made by initialize()
  bool first_delta_waiting = false;

  LocalView local;
  FrameSearch search;
  WideSearch wide;
  struct Doubtful {
    Frame frame;
    TrackOutcome outcome;
  };
  std::optional<Doubtful> doubtful;  ///< best doubtful pose of this frame
  Relocalizer relocalizer;
  TwoViewStart two_views;
  std::vector<SeenPoint> last_points;
};

}  // namespace slambed
