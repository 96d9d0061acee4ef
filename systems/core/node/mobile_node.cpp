// SPDX-License-Identifier: Apache-2.0
#include "node/mobile_node.hpp"

#include <algorithm>
#include <cmath>

#include "features/default_vocabulary.hpp"
#include "slam/place_index.hpp"

namespace slambed {
namespace {

constexpr Duration kFlushEvery = std::chrono::seconds(1);

std::string_view state_name(TrackingState state) {
  switch (state) {
    case TrackingState::kOk:
      return "ok";
    case TrackingState::kLost:
      return "lost";
    case TrackingState::kNotInitialised:
      break;
  }
  return "not_initialised";
}

std::string_view need_name(KeyFrameNeed need, bool first) {
  if (first) return "first";
  return need == KeyFrameNeed::kUrgent ? "urgent" : "if_mapper_agrees";
}

/// Observations that the new keyframe shares with others: each was counted for covisibility.
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

JsonLine frame_event(std::string_view type, const OfferedFrame& frame) {
  return JsonLine(type).add("frame", frame.played.index).add("seq_s", frame.played.seq_s());
}

}  // namespace

void spawn_log_writer(Runtime& runtime, EventLog& log) {
  runtime.spawn("event-log", [&log](Worker& worker) {
    while (!worker.stopping()) {
      worker.sleep_until(worker.now() + kFlushEvery);
      log.flush();
    }
  });
}

MobileNode::MobileNode(MobileParts parts, const System& system, const Parameters& parameters)
    : parts_(parts) {
  TrackerOptions options = suited(system.tracker(parameters), parts_.sensor);
  // ORB-SLAM2's mMaxFrames: one second.
  options.max_frames_between_keyframes =
      std::max(1, static_cast<int>(std::lround(parts_.played_fps)));
  places_ = std::make_shared<PlaceIndex>(default_vocabulary());
  const auto map = parts_.prior_map ? parts_.prior_map : std::make_shared<Map>();
  if (parts_.prior_map) {
    options.reset_below_keyframes = 0;  // what somebody gave us is never thrown away
    map->read([this](const MapView& view) {
      for (const KeyFrameId id : view.keyframe_ids())
        poses_.created(id, {}, SE3(), view.keyframe(id)->T_cw);
      return 0;
    });
  }
  tracker_ = std::make_unique<Tracker>(options, map, IdSpace::kTracker, places_);
  policy_ = system.mobile(*this, parameters);
}

MobileNode::~MobileNode() = default;

void MobileNode::start() {
  policy_->start();
  parts_.feed.start();
  parts_.runtime.spawn("tracking", [this](Worker& worker) { track(worker); });
}

void MobileNode::track(Worker& worker) {
  worker.sleep_until(RunTime::zero());
  while (const auto offered = parts_.feed.next(worker)) {
    policy_->before_frame(worker, *offered);
    const TrackingState before = tracker_->state();
    const RunTime begin = worker.now();
    TrackedFrame frame = track_frame(worker, *offered);
    frame.relocalised_now = before == TrackingState::kLost &&
                            frame.outcome.state == TrackingState::kOk &&
                            !frame.outcome.initialised_now;
    if (frame.outcome.reset_now) {
      pose_log_.clear();
      poses_.clear();
    }
    policy_->after_frame(worker, frame);
    if (frame.outcome.state == TrackingState::kOk) {
      pose_log_.add(parts_.time_origin_ns + parts_.timestamps_ns[offered->played.index],
                    frame.outcome.T_cw, frame.outcome.reference, frame.outcome.T_cr);
    }
    record(frame, before, worker.now() - begin);
    const bool lost = before == TrackingState::kOk && frame.outcome.state != TrackingState::kOk;
    if (lost && parts_.stop_at_first_loss) break;
  }
  finished_ = !worker.stopping();
  policy_->finish(worker);
  parts_.runtime.stop();
}

TrackedFrame MobileNode::track_frame(Worker& worker, const OfferedFrame& offered) {
  TrackedFrame frame{.offered = offered, .outcome = {}, .features = nullptr};
  frame.features = worker.stage("extract", [&](StageUnits& units) {
    auto features = parts_.features.features(offered.played.index);
    units.n1 = images_per_frame(parts_.sensor) * features->size();
    return features;
  });
  frame.features = policy_->before_tracking(worker, offered, std::move(frame.features));
  frame.outcome = worker.stage("track", [&](StageUnits& units) {
    const auto outcome =
        tracker_->track(offered.played.index, offered.played.seq_s(), frame.features);
    units.n1 = frame.features->size();
    units.n2 = std::max(outcome.local_points, outcome.searched_points);
    return outcome;
  });
  return frame;
}

void MobileNode::record(const TrackedFrame& frame, TrackingState before, Duration spent) {
  const TrackOutcome& outcome = frame.outcome;
  EventLog& log = parts_.log;
  if (before == TrackingState::kOk && outcome.state != TrackingState::kOk) {
    log.write(frame_event("track_lost", frame.offered));
  }
  if (outcome.reset_now) log.write(frame_event("reset", frame.offered));
  if (outcome.initialised_now) log.write(frame_event("initialised", frame.offered));
  if (frame.relocalised_now) {
    JsonLine event = frame_event("relocalised", frame.offered);
    if (const auto by = policy_->relocalised_by(frame); !by.empty()) event.add("by", by);
    log.write(event);
  }
  log.write(frame_event("frame_tracked", frame.offered)
                .add("state", state_name(outcome.state))
                .add("features", frame.features->size())
                .add("matches", outcome.matches)
                .add("inliers", outcome.inliers)
                .add("local_points", outcome.local_points)
                .add_ms("track_ms", spent)
                .add_ms("wait_ms", frame.offered.taken - frame.offered.offered));
}

MapDelta MobileNode::create_keyframe(Worker& worker, const TrackedFrame& frame, KeyFrameNeed need,
                                     bool becomes_reference) {
  MapDelta delta = worker.stage("create_keyframe", [&](StageUnits& units) {
    MapDelta made = tracker_->create_keyframe(becomes_reference);
    units.n1 = static_cast<double>(made.points.size());
    units.n2 = shared_observations(*tracker_->map(), made);
    return made;
  });
  for (const NewKeyFrame& keyframe : delta.keyframes) {
    if (frame.outcome.initialised_now) {
      poses_.created(keyframe.id, {}, SE3(), keyframe.T_cw);
    } else {
      poses_.created(keyframe.id, frame.outcome.reference, frame.outcome.T_cr, keyframe.T_cw);
    }
    // The first of two that start a map is an earlier frame.
    parts_.log.write(JsonLine("keyframe_created")
                         .add("frame", keyframe.frame_index)
                         .add("seq_s", keyframe.timestamp_s)
                         .add("keyframe", keyframe.id.value)
                         .add("new_points", delta.points.size())
                         .add("need", need_name(need, frame.outcome.initialised_now)));
  }
  return delta;
}

void MobileNode::replace_map(std::shared_ptr<Map> map, std::span<const KeyFrameId> provisional) {
  tracker_->replace_map(std::move(map), provisional);
}

void MobileNode::write_trajectories(const std::filesystem::path& folder) {
  policy_->place_keyframes(poses_);
  pose_log_.write_live(folder / "trajectory_live.txt");
  pose_log_.write_final(folder / "trajectory.txt", poses_);
}

}  // namespace slambed
