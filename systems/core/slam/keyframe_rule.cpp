// SPDX-License-Identifier: Apache-2.0
#include "slam/keyframe_rule.hpp"

namespace slambed {
namespace {

constexpr float kYoungMapRatio = 0.4f;  ///< c2 while the map has a single keyframe
constexpr int kLeastInliers = 15;       ///< c2 requires more than this
constexpr int kYoungMap = 2;            ///< keyframes

}  // namespace

int least_reference_weight(const KeyFrameEvidence& evidence) {
  if (evidence.keyframes == 1 && !evidence.metric) return 1;
  return evidence.keyframes <= kYoungMap || evidence.unpredicted ? 2 : 3;
}

KeyFrameNeed keyframe_need(const TrackerOptions& options, const KeyFrameEvidence& evidence) {
  if (!evidence.tracked) return KeyFrameNeed::kNone;
  // Right after a relocalization the pose is not trusted enough to build on.
  if (evidence.relocalized_ever &&
      evidence.frames_since_relocalization < options.max_frames_between_keyframes &&
      evidence.keyframes > options.max_frames_between_keyframes)
    return KeyFrameNeed::kNone;
  const bool need_close = evidence.close_tracked < options.close_points_wanted &&
                          evidence.close_untracked > options.close_points_available;
  const float ratio = evidence.keyframes < kYoungMap ? kYoungMapRatio : options.reference_ratio;
  const auto inliers = static_cast<float>(evidence.inliers);
  const auto reference = static_cast<float>(evidence.reference_matches);
  const bool c2 = (inliers < ratio * reference || need_close) && evidence.inliers > kLeastInliers;
  if (!c2) return KeyFrameNeed::kNone;
  const bool c1c = inliers < options.urgent_ratio * reference || need_close;
  return c1c ? KeyFrameNeed::kUrgent : KeyFrameNeed::kIfMapperAgrees;
}

bool wants_keyframe(const TrackerOptions& options, const KeyFrameEvidence& evidence,
                    const MapperStatus& mapper) {
  if (!mapper.accepts) return false;
  const KeyFrameNeed need = keyframe_need(options, evidence);
  if (need == KeyFrameNeed::kNone) return false;
  if (need == KeyFrameNeed::kIfMapperAgrees) {
    const bool c1a = evidence.frames_since_keyframe >= options.max_frames_between_keyframes;
    const bool c1b =
        evidence.frames_since_keyframe >= options.min_frames_between_keyframes && mapper.idle;
    if (!c1a && !c1b) return false;
  }
  return mapper.idle || mapper.queued < options.busy_queue;
}

}  // namespace slambed
