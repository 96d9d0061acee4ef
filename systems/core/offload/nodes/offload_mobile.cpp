// SPDX-License-Identifier: Apache-2.0
#include "offload/nodes/offload_mobile.hpp"

#include "offload/channels/rtt_monitor.hpp"
#include "offload/nodes/original_behavior.hpp"
#include "offload/nodes/settings.hpp"
#include "offload/relocalization/relocalization_by_map.hpp"

namespace slambed {
namespace {

/// ORB-SLAM2's mMaxFrames: how long the edge may decline keyframes after a relocalization.
double after_relocalization_s(const Parameters& parameters, double played_fps) {
  const int max_frames = original_behavior(parameters).max_frames;
  return max_frames > 0 ? max_frames / played_fps : 1.0;
}

DownlinkOptions with(DownlinkOptions options, const OffloadMobileParts& parts) {
  if (parts.applier) options.applier = parts.applier;
  return options;
}

}  // namespace

OffloadMobile::OffloadMobile(MobileNode& node, const Parameters& parameters,
                             const OffloadMobileParts& parts)
    : node_(node),
      codec_(message_codec(parameters)),
      channels_(node.runtime(), node.network(), node.log(), parameters),
      downlink_(node, channels_.map, with(downlink_options(parameters, codec_), parts)),
      shutdown_(node, channels_.control),
      uplink_(node, channels_.keyframe, codec_),
      relocalization_(parts.relocalization
                          ? parts.relocalization(node, channels_, downlink_, codec_)
                          : std::make_unique<MobileRelocalizationByMap>(
                                channels_.frame,
                                from_seconds(parameters.real("reloc_request_ms") / 1000), codec_)),
      after_relocalization_s_(after_relocalization_s(parameters, node.played_fps())),
      looks_after_extraction_(original_behavior(parameters).updates_after_extraction) {}

void OffloadMobile::start() {
  channels_.start();
  downlink_.start();
  relocalization_->start();
  spawn_rtt_monitor(node_.runtime(), node_.log(), channels_.keyframe);
}

void OffloadMobile::before_frame(Worker& worker) {
  relocalization_->before_frame(worker);
  if (!looks_after_extraction_) downlink_.before_frame(worker);
}

void OffloadMobile::before_tracking(Worker& worker, const OfferedFrame& frame,
                                    const std::shared_ptr<const FeatureSet>& features) {
  if (looks_after_extraction_) downlink_.before_frame(worker);
  relocalization_->before_tracking(worker, frame, features);
}

void OffloadMobile::relocalize_after_frame(Worker& worker, const TrackedFrame& frame) {
  relocalization_->after_frame(worker, frame);
}

void OffloadMobile::shut_down(Worker& worker) {
  relocalization_->finish();
  shutdown_.shut_down(worker, uplink_.last_sequence());
}

std::string_view OffloadMobile::relocalized_by(const TrackedFrame& frame) {
  const bool map = downlink_.came_from_map();
  return frame.outcome.resumed ? "edge" : map ? "map" : "local";
}

void OffloadMobile::note_relocalization(const TrackedFrame& frame) {
  if (frame.relocalized_now) relocalized_s_ = frame.offered.played.seq_s();
}

MapDelta OffloadMobile::create_keyframe(Worker& worker, const TrackedFrame& frame,
                                        KeyFrameNeed need, bool becomes_reference) {
  MapDelta made = node_.create_keyframe(worker, frame, need, becomes_reference);
  if (!made.keyframes.empty()) downlink_.keyframe_created(worker.now(), made, !becomes_reference);
  return made;
}

/// Observation counts matter only for points that are still on probation at the edge.
void OffloadMobile::leave_out_past_probation(MapDelta& made) const {
  const KeyFrameId newest_past_probation = downlink_.newest_past_probation();
  if (!newest_past_probation) return;
  node_.tracker().map()->read([&](const MapView& view) {
    return std::erase_if(made.observation_counts,
                         [&](const PointObservationCounts& observation_counts) {
                           const MapPoint* point = view.point(observation_counts.id);
                           return !point || point->first_keyframe <= newest_past_probation;
                         });
  });
}

void OffloadMobile::send(Worker& worker, const TrackedFrame& frame, MapDelta made,
                         KeyFrameNeed need, bool first, bool whole) {
  leave_out_past_probation(made);
  const double since_s = frame.offered.played.seq_s() - relocalized_s_;
  uplink_.send(worker, frame, std::move(made),
               {.need = need,
                .first = first,
                .whole = whole,
                .after_relocalization = relocalized_s_ >= 0 && since_s < after_relocalization_s_,
                .applied_update = downlink_.applied_update(),
                .newest_edge_point = downlink_.newest_edge_point()});
}

}  // namespace slambed
