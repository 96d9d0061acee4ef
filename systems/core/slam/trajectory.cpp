// SPDX-License-Identifier: Apache-2.0
#include "slam/trajectory.hpp"

#include <optional>

namespace slambed {

void TrajectoryRecorder::add(double timestamp_s, const TrackOutcome& outcome) {
  if (outcome.reset_now) {
    records_.clear();
    noted_.clear();
  }
  if (outcome.state != TrackingState::kOk) return;
  records_.push_back({timestamp_s, outcome.reference, outcome.T_cr, outcome.T_cw});
}

void TrajectoryRecorder::note(const Map& map) {
  map.read([&](const MapView& view) {
    KeyFrameId last;
    for (const Record& record : records_) {
      if (record.reference == last) continue;
      last = record.reference;
      if (const auto pose = view.pose_of(last)) noted_[last] = *pose;
    }
    return 0;
  });
}

std::vector<StampedPose> TrajectoryRecorder::final_poses(const Map& map) const {
  std::vector<StampedPose> poses;
  poses.reserve(records_.size());
  map.read([&](const MapView& view) {
    for (const Record& record : records_) {
      std::optional<SE3> T_rw = view.pose_of(record.reference);
      if (const auto noted = noted_.find(record.reference); !T_rw && noted != noted_.end())
        T_rw = noted->second;
      poses.push_back({record.timestamp_s, T_rw ? record.T_cr * *T_rw : record.T_cw});
    }
    return 0;
  });
  return poses;
}

std::vector<StampedPose> TrajectoryRecorder::live_poses() const {
  std::vector<StampedPose> poses;
  poses.reserve(records_.size());
  for (const Record& record : records_) poses.push_back({record.timestamp_s, record.T_cw});
  return poses;
}

}  // namespace slambed
