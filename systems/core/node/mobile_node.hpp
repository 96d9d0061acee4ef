// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <filesystem>
#include <memory>
#include <optional>

#include "node/event_log.hpp"
#include "node/policy.hpp"
#include "node/rtt_table.hpp"
#include "sequence/feature_source.hpp"
#include "sequence/image_source.hpp"

namespace slambed {

/// What the mobile node works with; all of it must outlive the node.
struct MobileParts {
  Runtime& runtime;
  Network* network;  ///< null for a system without an edge
  EventLog& log;
  FeatureSource& features;
  FrameFeed& feed;
  const PreparedSequence* sequence = nullptr;  ///< null: features have no pictures
  SensorKind sensor = SensorKind::kRgbd;
  double played_fps = 30;
  bool stop_at_first_loss = false;              ///< playback ends with the first track loss
  std::span<const std::int64_t> timestamps_ns;  ///< of the whole sequence
  std::int64_t time_origin_ns = 0;
  /// Map to start from: tracking starts lost in it. Null: tracking makes the first keyframe.
  std::shared_ptr<Map> prior_map{};
  std::optional<RttTable> profile_rtt{};
  ImageSource* images = nullptr;  ///< null: no pictures go to the edge
};

/// The mobile node tracks the played frames and leaves the rest to the system's policy. The same
/// code runs live and in virtual time.
class MobileNode {
 public:
  MobileNode(MobileParts parts, const System& system, const Parameters& parameters);
  ~MobileNode();

  /// Spawns the workers. The run stops by itself after the last frame.
  void start();
  /// Writes trajectory.txt and trajectory_live.txt. Call it after the runtime has joined.
  void write_trajectories(const std::filesystem::path& folder);
  bool finished() const { return finished_; }  ///< played to the end
  MapCounts counts() const { return policy_->counts(); }

  // What a policy may call.
  Runtime& runtime() { return parts_.runtime; }
  Network& network() { return *parts_.network; }
  EventLog& log() { return parts_.log; }
  FrameTracking& tracking() { return *tracking_; }
  Tracker& tracker() { return tracking_->tracker(); }
  /// Index of similar keyframes, which tracking also uses to relocalize.
  std::shared_ptr<PlaceIndex> places() const { return places_; }
  /// Images of the frame, valid as long as the node; nothing if its features come from elsewhere.
  std::optional<PreparedSequence::Frame> picture(const OfferedFrame& frame) const {
    if (parts_.sequence == nullptr) return std::nullopt;
    return parts_.sequence->frame(frame.played.index);
  }
  /// Pictures for the edge; only for systems with a jpeg_quality.
  ImageSource& images() { return *parts_.images; }
  /// Extracts features of later frames from this many octaves; only for systems with orb_levels.
  void use_levels(int levels);
  double played_fps() const { return parts_.played_fps; }
  /// RTT of the link profile; nothing if run.json has none.
  const std::optional<RttTable>& profile_rtt() const { return parts_.profile_rtt; }
  std::shared_ptr<const Sensor> sensor() const { return parts_.features.sensor(); }
  /// See FrameTracking::create_keyframe.
  MapDelta create_keyframe(Worker& worker, const TrackedFrame& frame, KeyFrameNeed need,
                           bool becomes_reference) {
    return tracking_->create_keyframe(worker, frame, need, becomes_reference);
  }
  /// See Tracker::replace_map.
  void replace_map(std::shared_ptr<Map> map, std::span<const KeyFrameId> provisional = {});
  PoseBook& poses() { return tracking_->poses(); }
  /// Takes the result of a frame that the other node tracked. Call it from one worker, in frame
  /// order.
  void tracked_elsewhere(std::uint64_t frame, const TrackOutcome& outcome);

 private:
  void track(Worker& worker);
  /// Returns true if tracking was lost in this frame.
  bool track_frame(Worker& worker, const OfferedFrame& offered);
  void log_pose(std::uint64_t frame, const TrackOutcome& outcome);

  MobileParts parts_;
  std::shared_ptr<PlaceIndex> places_;
  std::unique_ptr<FrameTracking> tracking_;
  std::unique_ptr<MobilePolicy> policy_;
  PoseLog pose_log_;
  std::atomic<bool> lost_elsewhere_{false};
  double pyramid_pixels_ = 0;  ///< of a frame's octaves, in full images
  TrackingState elsewhere_ = TrackingState::kNotInitialized;
  bool finished_ = false;
};

/// Writes the log to disk once a second until the run stops.
void spawn_log_writer(Runtime& runtime, EventLog& log);

}  // namespace slambed
