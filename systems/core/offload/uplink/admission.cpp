// SPDX-License-Identifier: Apache-2.0
#include "offload/uplink/admission.hpp"

#include <algorithm>
#include <set>

namespace slambed {
namespace {

/// ORB-SLAM2 counts mMaxFrames, one second of frames at the played rate.
constexpr double kMaxGapS = 1.0;
constexpr double kHalfFrame = 0.5;

}  // namespace

std::optional<std::string_view> keyframe_decline_reason(const wire::KeyFrameMessage& message,
                                                        const AdmissionState& state) {
  if (!state.mapper.accepts) return "mapper stopped";
  const double max_gap_s = state.max_frames > 0 ? state.max_frames / state.played_fps : kMaxGapS;
  const double time_s = message.delta.keyframes.back().timestamp_s;
  if (state.last_accepted_s >= 0 && time_s <= state.last_accepted_s) {
    return "older than the last accepted";
  }
  if (message.first) return std::nullopt;
  if (state.last_accepted_s < 0) {
    if (message.whole || state.keyframes > 0) return std::nullopt;
    return kNoMap;
  }
  if (message.after_relocalization &&
      static_cast<double>(state.keyframes) > state.played_fps * max_gap_s) {
    return "just relocalized";
  }
  if (!message.urgent && !state.mapper.idle) {
    const double gap_s = time_s - state.last_accepted_s;
    if (gap_s < max_gap_s - kHalfFrame / state.played_fps) return "mapper busy";
  }
  if (!state.mapper.idle && state.mapper.queued >= state.queue_limit) return "queue full";
  return std::nullopt;
}

MapDelta rebase_keyframe(const MapView& view, MapDelta delta) {
  std::set<MapPointId> fresh;
  for (const NewPoint& point : delta.points) fresh.insert(point.id);
  for (NewKeyFrame& keyframe : delta.keyframes) {
    std::set<MapPointId> seen;
    for (MapPointId& id : keyframe.points) {
      if (!id) continue;
      const MapPointId now = view.resolve(id);
      if (now && view.point(now)) {
        id = now;
      } else if (!fresh.contains(id)) {
        id = {};
      }
      if (id && !seen.insert(id).second) id = {};
    }
    if (keyframe.parent && !view.keyframe(keyframe.parent)) keyframe.parent = {};
  }
  // A new point that lost its only observation would never be seen again.
  std::set<MapPointId> used;
  for (const NewKeyFrame& keyframe : delta.keyframes) {
    used.insert(keyframe.points.begin(), keyframe.points.end());
  }
  std::erase_if(delta.points, [&](const NewPoint& point) { return !used.contains(point.id); });
  return delta;
}

}  // namespace slambed
