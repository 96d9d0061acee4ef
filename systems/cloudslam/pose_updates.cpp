// SPDX-License-Identifier: Apache-2.0
#include "cloudslam/pose_updates.hpp"

#include <limits>

#include "node/messaging.hpp"

namespace slambed {
namespace {

JsonLine event(std::string_view type, const wire::PoseAnswer& answer, const Message& raw,
               double seq_s) {
  const RunTime answered = answer.sent + answer.up + answer.wait + answer.match + answer.bundle;
  return JsonLine(type)
      .add("keyframe", answer.keyframe.value)
      .add("seq_s", seq_s)
      .add("matches", answer.matches)
      .add_ms("t_up_ms", answer.up)
      .add_ms("t_wait_ms", answer.wait)
      .add_ms("t_match_ms", answer.match)
      .add_ms("t_bundle_ms", answer.bundle)
      .add_ms("t_down_ms", raw.received - answered)
      .add_ms("t_response_ms", raw.received - answer.sent);
}

}  // namespace

std::optional<std::string_view> PoseUpdates::objection(const wire::PoseAnswer& answer,
                                                       bool whole_map) const {
  if (const auto reason = wire::defect(answer)) return reason;
  if (!whole_map && answer.keyframe <= applied_) return "older";
  const bool known = node_.tracker().map()->read(
      [&](const MapView& view) { return view.pose_of(answer.keyframe).has_value(); });
  if (!known) return "unknown_keyframe";
  return std::nullopt;
}

std::optional<PoseCorrection> PoseUpdates::apply(Worker& worker, const Message& raw, bool whole_map,
                                                 double seq_s) {
  const auto read_well = read(node_.log(), raw, wire::decode_pose_answer);
  if (!read_well) return std::nullopt;
  const wire::PoseAnswer& answer = *read_well;
  if (answer.matches == 0) {
    node_.log().write(event("pose_update_empty", answer, raw, seq_s));
    return std::nullopt;
  }
  if (const auto reason = objection(answer, whole_map)) {
    node_.log().write(event("pose_update_declined", answer, raw, seq_s).add("reason", *reason));
    return std::nullopt;
  }
  PoseCorrection correction = correct(worker, answer, whole_map);
  applied_ = std::max(applied_, answer.keyframe);
  node_.log().write(event("pose_update_applied", answer, raw, seq_s)
                        .add("initial", whole_map)
                        .add("magnitude_m", correction.magnitude_m)
                        .add("rotation_deg", correction.rotation_deg));
  return correction;
}

PoseCorrection PoseUpdates::correct(Worker& worker, const wire::PoseAnswer& answer,
                                    bool whole_map) {
  CorrectionWindow window = window_;
  if (whole_map) window.window_s = std::numeric_limits<double>::infinity();
  PoseCorrection correction;
  worker.stage("apply_correction", [&](StageUnits& units) {
    const KeyFrameId reference = node_.tracker().reference();
    std::optional<SE3> T_rw;
    mapping_.correct(*node_.tracker().map(), [&](const MapView& view) {
      T_rw = view.pose_of(reference);
      correction = correct_pose(view, answer.keyframe, answer.T_cw, window).value();
      units = {static_cast<double>(correction.delta.poses.size()),
               static_cast<double>(correction.delta.positions.size())};
      return std::make_pair(std::move(correction.delta),
                            BundleLimits{.since_s = correction.since_s,
                                         .held = whole_map ? KeyFrameId{} : answer.keyframe});
    });
    if (T_rw) node_.tracker().moved(correction.T_new_old, *T_rw);
  });
  return correction;
}

}  // namespace slambed
