// SPDX-License-Identifier: Apache-2.0
#include "node/mobile_node.hpp"

#include <algorithm>

#include "features/default_vocabulary.hpp"
#include "slam/place_index.hpp"

namespace slambed {
namespace {

constexpr Duration kFlushEvery = std::chrono::seconds(1);

/// Pixels of the first `levels` octaves, in full images.
double pixels_of(const ScalePyramid& pyramid, int levels) {
  double pixels = 0;
  for (int level = 0; level < std::min(levels, pyramid.levels()); ++level)
    pixels += 1 / (double{pyramid.scale[level]} * pyramid.scale[level]);
  return pixels;
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
    : parts_(std::move(parts)) {
  TrackerOptions options = at_rate(system.tracker(parameters), parts_.sensor, parts_.played_fps);
  places_ = std::make_shared<PlaceIndex>(default_vocabulary());
  const auto map = parts_.prior_map ? parts_.prior_map : std::make_shared<Map>();
  if (parts_.prior_map) {
    options.reset_below_keyframes = 0;  // a given map is never discarded
  }
  tracking_ = std::make_unique<FrameTracking>(parts_.log, options, map, places_);
  if (parts_.prior_map) {
    map->read([this](const MapView& view) {
      for (const KeyFrameId id : view.keyframe_ids())
        poses().created(id, {}, SE3(), view.keyframe(id)->T_cw);
      return 0;
    });
  }
  pyramid_pixels_ = pixels_of(sensor()->pyramid, sensor()->pyramid.levels());
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
    if (track_frame(worker, *offered) && parts_.stop_at_first_loss) break;
  }
  finished_ = !worker.stopping();
  policy_->finish(worker);
  parts_.runtime.stop();
}

bool MobileNode::track_frame(Worker& worker, const OfferedFrame& offered) {
  if (policy_->offload(worker, offered)) return lost_elsewhere_;
  const std::uint64_t index = offered.played.index;
  const TrackedFrame frame = tracking_->track(
      worker, offered,
      [&](StageUnits& units) {
        auto features = parts_.features.features(index);
        units.n1 = images_per_frame(parts_.sensor) * features->size();
        units.n2 = images_per_frame(parts_.sensor) * pyramid_pixels_;
        return features;
      },
      *policy_);
  log_pose(index, frame.outcome);
  return frame.lost_now;
}

void MobileNode::use_levels(int levels) {
  parts_.features.use_levels(levels);
  pyramid_pixels_ = pixels_of(sensor()->pyramid, levels);
}

void MobileNode::log_pose(std::uint64_t frame, const TrackOutcome& outcome) {
  if (outcome.reset_now) pose_log_.clear();
  if (outcome.state != TrackingState::kOk) return;
  pose_log_.add(parts_.time_origin_ns + parts_.timestamps_ns[frame], outcome.T_cw,
                outcome.reference, outcome.T_cr);
}

void MobileNode::tracked_elsewhere(std::uint64_t frame, const TrackOutcome& outcome) {
  if (elsewhere_ == TrackingState::kOk && outcome.state != TrackingState::kOk)
    lost_elsewhere_ = true;
  elsewhere_ = outcome.state;
  if (outcome.reset_now) poses().clear();
  log_pose(frame, outcome);
}

void MobileNode::replace_map(std::shared_ptr<Map> map, std::span<const KeyFrameId> provisional) {
  tracker().replace_map(std::move(map), provisional);
}

void MobileNode::write_trajectories(const std::filesystem::path& folder) {
  policy_->place_keyframes(poses());
  pose_log_.write_live(folder / "trajectory_live.txt");
  pose_log_.write_final(folder / "trajectory.txt", poses());
}

}  // namespace slambed
