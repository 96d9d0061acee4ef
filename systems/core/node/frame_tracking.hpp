// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <string_view>

#include "node/playback.hpp"
#include "node/pose_log.hpp"
#include "slam/tracker.hpp"

namespace slambed {

/// One frame after tracking.
struct TrackedFrame {
  OfferedFrame offered;
  TrackOutcome outcome;
  std::shared_ptr<const FeatureSet> features;
  bool relocalized_now = false;
  bool lost_now = false;
};

/// What a system decides about each frame, on whichever node it is tracked.
class TrackingPolicy {
 public:
  virtual ~TrackingPolicy() = default;
  /// Between extraction and tracking: the features that tracking is to see. A policy may look at
  /// the picture (MobileNode::picture), leave some out (select) or let tracking see none.
  virtual std::shared_ptr<const FeatureSet> before_tracking(
      Worker&, const OfferedFrame&, std::shared_ptr<const FeatureSet> features) {
    return features;
  }
  /// After each frame: whether to make a keyframe, and what becomes of it.
  virtual void after_frame(Worker& worker, const TrackedFrame& frame) = 0;
  /// Of a frame in which a lost camera was found: with whose help ("local", "edge", "map"); empty:
  /// the system does not tell.
  virtual std::string_view relocalized_by(const TrackedFrame&) { return {}; }
};

/// The tracker's options for a sensor and a played rate: ORB-SLAM2's mMaxFrames is one second,
/// unless they say otherwise.
TrackerOptions at_rate(TrackerOptions options, SensorKind sensor, double played_fps);

/// Tracks frame after frame on the node that has them, and records what became of each: stages
/// `extract`, `track` and `create_keyframe`, events `frame_tracked`, `track_lost`, `relocalized`,
/// `initialized`, `reset` and `keyframe_created`. Belongs to one worker.
class FrameTracking {
 public:
  /// Within the stage `extract`; says how large the work was.
  using Extract = std::function<std::shared_ptr<const FeatureSet>(StageUnits&)>;

  FrameTracking(EventLog& log, const TrackerOptions& options, std::shared_ptr<Map> map,
                std::shared_ptr<PlaceIndex> places);

  TrackedFrame track(Worker& worker, const OfferedFrame& offered, const Extract& extract,
                     TrackingPolicy& policy);
  /// Makes a keyframe of the frame just tracked and records it.
  MapDelta create_keyframe(Worker& worker, const TrackedFrame& frame, KeyFrameNeed need,
                           bool becomes_reference);

  Tracker& tracker() { return tracker_; }
  PoseBook& poses() { return poses_; }

 private:
  void record(const TrackedFrame& frame, Duration spent, TrackingPolicy& policy);

  EventLog& log_;
  Tracker tracker_;
  PoseBook poses_;
  std::size_t next_place_ = 0;  ///< of the frame behind the last one tracked
};

}  // namespace slambed
