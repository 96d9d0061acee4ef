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

/// A system's decisions about each frame, on the node that tracks it.
class TrackingPolicy {
 public:
  virtual ~TrackingPolicy() = default;
  /// Called between extraction and tracking; returns the features to track. A policy may look at
  /// the picture (MobileNode::picture), drop some features (select) or drop all.
  virtual std::shared_ptr<const FeatureSet> before_tracking(
      Worker&, const OfferedFrame&, std::shared_ptr<const FeatureSet> features) {
    return features;
  }
  /// Called after each frame: decides whether to make a keyframe and what to do with it.
  virtual void after_frame(Worker& worker, const TrackedFrame& frame) = 0;
  /// What relocalized the frame ("local", "edge", "map"); empty: the system does not report it.
  virtual std::string_view relocalized_by(const TrackedFrame&) { return {}; }
};

/// Adapts the tracker's options to a sensor and a played rate. Sets ORB-SLAM2's mMaxFrames to one
/// second unless max_frames_is_a_second is off.
TrackerOptions at_rate(TrackerOptions options, SensorKind sensor, double played_fps);

/// Tracks frames on either node and logs the results: stages `extract`, `track` or `relocalize`,
/// and `create_keyframe`; events `frame_tracked`, `track_lost`, `relocalized`, `initialized`,
/// `reset` and `keyframe_created`. Belongs to one worker.
class FrameTracking {
 public:
  /// Runs in the stage `extract` and sets its units.
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
  std::size_t next_place_ = 0;  ///< of the frame after the last one tracked
};

}  // namespace slambed
