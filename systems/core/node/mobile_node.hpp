// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include "node/event_log.hpp"
#include "node/feature_source.hpp"
#include "node/policy.hpp"
#include "node/rtt_table.hpp"

namespace slambed {

/// What the mobile node works with; all of it outlives the node.
struct MobileParts {
  Runtime& runtime;
  Network* network;  ///< null for a system without an edge
  EventLog& log;
  FeatureSource& features;
  FrameFeed& feed;
  const PreparedSequence* sequence = nullptr;  ///< null: features have no pictures
  SensorKind sensor = SensorKind::kRgbd;
  double played_fps = 30;
  bool stop_at_first_loss = false;  ///< playback ends with the first track loss
  std::span<const std::int64_t> timestamps_ns;  ///< of the whole sequence
  std::int64_t time_origin_ns = 0;
  /// A map made before: tracking starts lost in it. Null: tracking makes the first keyframe.
  std::shared_ptr<Map> prior_map{};
  std::optional<RttTable> profile_rtt{};
};

/// The mobile node: tracks what playback offers and lets the system's policy decide the rest. The
/// same code runs live and in virtual time.
class MobileNode {
 public:
  MobileNode(MobileParts parts, const System& system, const Parameters& parameters);
  ~MobileNode();

  /// Spawns the workers. The run stops by itself after the last frame.
  void start();
  /// After the runtime has joined: trajectory.txt and trajectory_live.txt.
  void write_trajectories(const std::filesystem::path& folder);
  bool finished() const { return finished_; }  ///< played to the end
  MapCounts counts() const { return policy_->counts(); }

  // The verbs of a policy.
  Runtime& runtime() { return parts_.runtime; }
  Network& network() { return *parts_.network; }
  EventLog& log() { return parts_.log; }
  Tracker& tracker() { return *tracker_; }
  /// Which keyframes look alike; tracking finds lost frames with it.
  std::shared_ptr<PlaceIndex> places() const { return places_; }
  /// The images that a frame's features come from; they last as long as the node. Nothing where
  /// features come from elsewhere.
  std::optional<PreparedSequence::Frame> picture(const OfferedFrame& frame) const {
    if (parts_.sequence == nullptr) return std::nullopt;
    return parts_.sequence->frame(frame.played.index);
  }
  double played_fps() const { return parts_.played_fps; }
  /// What the link's profile asks for; nothing where the run does not tell.
  const std::optional<RttTable>& profile_rtt() const { return parts_.profile_rtt; }
  std::shared_ptr<const Sensor> sensor() const { return parts_.features.sensor(); }
  /// Makes a keyframe of the frame just tracked and records it.
  MapDelta create_keyframe(Worker& worker, const TrackedFrame& frame, KeyFrameNeed need,
                           bool becomes_reference);
  /// Lets tracking go on with another map; see Tracker::replace_map.
  void replace_map(std::shared_ptr<Map> map, std::span<const KeyFrameId> provisional = {});
  PoseBook& poses() { return poses_; }

 private:
  void track(Worker& worker);
  TrackedFrame track_frame(Worker& worker, const OfferedFrame& offered);
  void record(const TrackedFrame& frame, TrackingState before, Duration spent);

  MobileParts parts_;
  std::shared_ptr<PlaceIndex> places_;
  std::unique_ptr<Tracker> tracker_;
  std::unique_ptr<MobilePolicy> policy_;
  PoseLog pose_log_;
  PoseBook poses_;
  bool finished_ = false;
};

/// Writes the log to disk once a second until the run stops.
void spawn_log_writer(Runtime& runtime, EventLog& log);

}  // namespace slambed
