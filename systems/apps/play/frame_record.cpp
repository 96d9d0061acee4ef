// SPDX-License-Identifier: Apache-2.0
#include "apps/play/frame_record.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.hpp"

namespace slambed {
namespace {

constexpr const char* kStates[] = {"ok", "lost", "not_initialized"};
/// Tolerance for the length of a unit quaternion in single precision.
constexpr double kUnitTolerance = 1e-3;
/// Limit of the coordinates of a pose: farther than any camera goes, and inverting the pose cannot
/// overflow.
constexpr double kFarthest_m = 1e9;

JsonLine frame_event(std::string_view type, const OfferedFrame& frame) {
  return JsonLine(type).add("frame", frame.played.index).add("seq_s", frame.played.seq_s());
}

SE3 camera_pose(const slambed_pose& pose) {
  const Eigen::Map<const Eigen::Vector3d> t(pose.t_wc);
  const Eigen::Quaterniond q(pose.q_wc[3], pose.q_wc[0], pose.q_wc[1], pose.q_wc[2]);
  if (!(t.cwiseAbs().maxCoeff() < kFarthest_m) || !t.allFinite() ||
      !(std::abs(q.norm() - 1) < kUnitTolerance)) {
    throw bad_input("the pose of frame " + std::to_string(pose.index) +
                    " is no pose: send meters (less than 1e9) and a unit quaternion x y z w");
  }
  return SE3(q, t).inverse();
}

void write(const std::filesystem::path& path, const std::map<std::uint64_t, SE3>& poses,
           const std::map<std::uint64_t, std::int64_t>& recorded_ns) {
  PoseLog log;
  for (const auto& [index, T_cw] : poses) log.add(recorded_ns.at(index), T_cw, {}, SE3());
  log.write_live(path);
}

/// Written by the player of what a system answers; a second one would be counted too.
constexpr std::array<std::string_view, 6> kOwnEvents{"frame_tracked", "frame_dropped", "track_lost",
                                                     "relocalized",   "initialized",   "reset"};

}  // namespace

JsonLine system_event(std::string_view text) {
  const auto json = nlohmann::json::parse(text, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object() || !json.contains("type") || !json["type"].is_string()) {
    throw bad_input("an event of the system is no JSON object with a type: " +
                    std::string(text.substr(0, 80)));
  }
  const auto type = json["type"].get<std::string>();
  if (type.empty()) throw bad_input("an event of the system has an empty type");
  if (std::ranges::find(kOwnEvents, type) != kOwnEvents.end()) {
    throw bad_input("an event of the system is called " + type +
                    ", which the player writes for it; take another name");
  }
  JsonLine line(type);
  for (const auto& [key, value] : json.items()) {
    if (key == "type" || key == "t_ns") continue;
    if (value.is_boolean())
      line.add(key, value.get<bool>());
    else if (value.is_number_integer())
      line.add(key, value.get<std::int64_t>());
    else if (value.is_number())
      line.add(key, value.get<double>());
    else
      line.add(key, value.is_string() ? value.get<std::string>() : value.dump());
  }
  return line;
}

void FrameRecord::dequeued(const OfferedFrame& frame, std::int64_t recorded_ns) {
  waiting_[frame.played.index] = {frame, recorded_ns};
}

void FrameRecord::tracked(const slambed_pose& pose, RunTime now) {
  const auto found = waiting_.find(pose.index);
  if (found == waiting_.end() || pose.state > SLAMBED_NOT_INITIALIZED) {
    throw bad_input("a pose of frame " + std::to_string(pose.index) + ", state " +
                    std::to_string(pose.state) +
                    ": send one per frame that was given, in their order");
  }
  std::optional<SE3> T_cw;
  if (pose.state == SLAMBED_OK) T_cw = camera_pose(pose);
  while (waiting_.begin()->first != pose.index) {
    const Dequeued passed = waiting_.extract(waiting_.begin()).mapped();
    record(passed, had_pose_ ? SLAMBED_LOST : SLAMBED_NOT_INITIALIZED, now, nullptr);
  }
  const Dequeued frame = waiting_.extract(waiting_.begin()).mapped();
  if (T_cw) {
    live_[pose.index] = *T_cw;
    recorded_ns_[pose.index] = frame.recorded_ns;
  }
  record(frame, pose.state, now, &pose);
}

void FrameRecord::record(const Dequeued& frame, std::uint32_t state, RunTime now,
                         const slambed_pose* pose) {
  const OfferedFrame& offered = frame.offered;
  if (state_ == SLAMBED_OK && state != SLAMBED_OK) {
    ++losses_;
    log_.write(frame_event("track_lost", offered));
  }
  if (state == SLAMBED_OK && state_ == SLAMBED_NOT_INITIALIZED) {
    log_.write(frame_event("initialized", offered));
  }
  if (state == SLAMBED_OK && state_ == SLAMBED_LOST) {
    log_.write(frame_event("relocalized", offered));
  }
  had_pose_ = had_pose_ || state == SLAMBED_OK;
  state_ = state;
  JsonLine line = frame_event("frame_tracked", offered).add("state", kStates[state]);
  if (pose != nullptr && pose->features >= 0) line.add("features", pose->features);
  if (pose != nullptr && pose->inliers >= 0) line.add("inliers", pose->inliers);
  if (pose != nullptr) line.add_ms("track_ms", now - offered.dequeued);
  log_.write(line.add_ms("wait_ms", offered.dequeued - offered.offered));
}

void FrameRecord::placed(const slambed_pose& pose) {
  if (!recorded_ns_.contains(pose.index)) {
    throw bad_input("a final pose of frame " + std::to_string(pose.index) +
                    ", which was not tracked: send final poses of tracked frames only");
  }
  final_[pose.index] = camera_pose(pose);
}

void FrameRecord::over(RunTime now) {
  for (const auto& [index, frame] : waiting_) {
    record(frame, had_pose_ ? SLAMBED_LOST : SLAMBED_NOT_INITIALIZED, now, nullptr);
  }
  waiting_.clear();
}

void FrameRecord::write_trajectories(const std::filesystem::path& folder) const {
  write(folder / "trajectory_live.txt", live_, recorded_ns_);
  write(folder / "trajectory.txt", final_.empty() ? live_ : final_, recorded_ns_);
}

}  // namespace slambed
