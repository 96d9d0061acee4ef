// SPDX-License-Identifier: Apache-2.0
#include "node/frame_tracking.hpp"

#include <algorithm>
#include <cmath>

namespace slambed {
namespace {

std::string_view state_name(TrackingState state) {
  switch (state) {
    case TrackingState::kOk:
      return "ok";
    case TrackingState::kLost:
      return "lost";
    case TrackingState::kNotInitialized:
      break;
  }
  return "not_initialized";
}

std::string_view need_name(KeyFrameNeed need, bool first) {
  if (first) return "first";
  return need == KeyFrameNeed::kUrgent ? "urgent" : "if_mapper_agrees";
}

/// Counts the observations that the new keyframe shares with others, the work of covisibility.
double shared_observations(const Map& map, const MapDelta& made) {
  return map.read([&](const MapView& view) {
    double shared = 0;
    for (const NewKeyFrame& keyframe : made.keyframes) {
      const KeyFrame* found = view.keyframe(keyframe.id);
      if (!found) continue;
      for (const Covisible& covisible : found->covisibles) shared += covisible.weight;
    }
    return shared;
  });
}

/// Adds the matches of each search, unless the motion model alone gave the pose.
void add_search(JsonLine& event, const TrackOutcome& outcome) {
  const PoseSearch& search = outcome.search;
  if (outcome.by_motion_model || (!search.motion_matches && !search.word_matches)) return;
  event.add("by_motion_model", false);
  const auto add = [&](std::string_view name, std::optional<int> matches) {
    if (matches) event.add(name, *matches);
  };
  add("motion_matches", search.motion_matches);
  add("word_matches", search.word_matches);
  add("reference_matches", search.reference_matches);
}

JsonLine frame_event(std::string_view type, const OfferedFrame& frame) {
  return JsonLine(type).add("frame", frame.played.index).add("seq_s", frame.played.seq_s());
}

}  // namespace

TrackerOptions at_rate(TrackerOptions options, SensorKind sensor, double played_fps) {
  options = suited(options, sensor);
  if (options.max_frames_is_a_second)
    options.max_frames_between_keyframes = std::max(1, static_cast<int>(std::lround(played_fps)));
  return options;
}

FrameTracking::FrameTracking(EventLog& log, const TrackerOptions& options, std::shared_ptr<Map> map,
                             std::shared_ptr<PlaceIndex> places)
    : log_(log), tracker_(options, std::move(map), IdSpace::kTracker, std::move(places)) {}

TrackedFrame FrameTracking::track(Worker& worker, const OfferedFrame& offered,
                                  const Extract& extract, TrackingPolicy& policy) {
  const TrackingState before = tracker_.state();
  const RunTime begin = worker.now();
  TrackedFrame frame{.offered = offered, .outcome = {}, .features = nullptr};
  frame.features = worker.stage("extract", extract);
  frame.features = policy.before_tracking(worker, offered, std::move(frame.features));
  const bool lost = tracker_.searches_whole_map();
  frame.outcome = worker.stage(lost ? "relocalize" : "track", [&](StageUnits& units) {
    const auto outcome =
        tracker_.track(offered.played.index, offered.played.seq_s(), frame.features);
    units.n1 = frame.features->size();
    units.n2 =
        lost ? outcome.candidates_posed : std::max(outcome.local_points, outcome.searched_points);
    return outcome;
  });
  const bool ok = frame.outcome.state == TrackingState::kOk;
  frame.relocalized_now = before == TrackingState::kLost && ok && !frame.outcome.initialized_now;
  frame.lost_now = before == TrackingState::kOk && !ok;
  if (frame.outcome.reset_now) poses_.clear();
  policy.after_frame(worker, frame);
  record(frame, worker.now() - begin, policy);
  return frame;
}

void FrameTracking::record(const TrackedFrame& frame, Duration spent, TrackingPolicy& policy) {
  const TrackOutcome& outcome = frame.outcome;
  if (frame.lost_now) log_.write(frame_event("track_lost", frame.offered));
  if (outcome.reset_now) log_.write(frame_event("reset", frame.offered));
  if (outcome.initialized_now) log_.write(frame_event("initialized", frame.offered));
  if (frame.relocalized_now) {
    JsonLine event = frame_event("relocalized", frame.offered);
    if (const auto by = policy.relocalized_by(frame); !by.empty()) event.add("by", by);
    log_.write(event);
  }
  JsonLine event = frame_event("frame_tracked", frame.offered);
  event.add("state", state_name(outcome.state))
      .add("features", frame.features->size())
      .add("matches", outcome.matches)
      .add("inliers", outcome.inliers)
      .add("local_points", outcome.local_points)
      .add_ms("track_ms", spent)
      .add_ms("wait_ms", frame.offered.dequeued - frame.offered.offered);
  add_search(event, outcome);
  const std::size_t place = frame.offered.played.place;
  if (place > next_place_) event.add("missing_frames", place - next_place_);
  next_place_ = place + 1;
  log_.write(event);
}

MapDelta FrameTracking::create_keyframe(Worker& worker, const TrackedFrame& frame,
                                        KeyFrameNeed need, bool becomes_reference) {
  MapDelta delta = worker.stage("create_keyframe", [&](StageUnits& units) {
    MapDelta made = tracker_.create_keyframe(becomes_reference);
    units.n1 = static_cast<double>(made.points.size());
    units.n2 = shared_observations(*tracker_.map(), made);
    return made;
  });
  for (const NewKeyFrame& keyframe : delta.keyframes) {
    if (frame.outcome.initialized_now) {
      poses_.created(keyframe.id, {}, SE3(), keyframe.T_cw);
    } else {
      poses_.created(keyframe.id, frame.outcome.reference, frame.outcome.T_cr, keyframe.T_cw);
    }
    // The first of two keyframes that start a map comes from an earlier frame.
    log_.write(JsonLine("keyframe_created")
                   .add("frame", keyframe.frame_index)
                   .add("seq_s", keyframe.timestamp_s)
                   .add("keyframe", keyframe.id.value)
                   .add("new_points", delta.points.size())
                   .add("need", need_name(need, frame.outcome.initialized_now)));
  }
  return delta;
}

}  // namespace slambed
