// SPDX-License-Identifier: Apache-2.0
#include "edgeslam/policies.hpp"

#include <array>

#include "offload/rtt_monitor.hpp"
#include "offload/update_content.hpp"

namespace slambed {
namespace {

/// ORB-SLAM2's mMaxFrames: for a second after a relocalisation poses are not trusted with
/// keyframes.
constexpr double kAfterRelocalisationS = 1;

UpdateRules update_rules(const Parameters& parameters) {
  return {.min_local_keyframes = parameters.integer("min_local_keyframes"),
          .fast_motion = from_seconds(parameters.real("fast_motion_ms") / 1000)};
}

EdgeMappingOptions mapping_options(const Parameters& parameters) {
  return {.queue_limit = parameters.integer("edge_queue"),
          .update_keyframes = parameters.integer("n_kf"),
          .update_neighbours = parameters.integer("update_neighbours"),
          .update_period = from_seconds(parameters.real("sync_period_s")),
          .update_poses = parameters.boolean("update_poses")};
}

}  // namespace

EdgeSlamChannels::EdgeSlamChannels(Network& network, int keyframe_queue)
    : control(network.open({.name = "control", .heartbeat = true})),
      keyframe(network.open(
          {.name = "keyframe", .send_queue = keyframe_queue, .receive_queue = keyframe_queue})),
      map(network.open({.name = "map", .receive_queue = 1})),
      frame(network.open({.name = "frame", .send_queue = 1, .receive_queue = 1})) {}

EdgeSlamMobile::EdgeSlamMobile(MobileNode& node, const Parameters& parameters)
    : node_(node),
      channels_(node.network(), parameters.integer("keyframe_queue")),
      uplink_(node, channels_.keyframe),
      downlink_(node, channels_.map,
                parameters.text("map_update") == "parallel" ? MapDownlink::Mode::kParallel
                                                            : MapDownlink::Mode::kSerial,
                update_rules(parameters)),
      relocalisation_(channels_.frame, from_seconds(parameters.real("reloc_request_ms") / 1000)),
      farewell_(node, channels_.control) {}

void EdgeSlamMobile::start() {
  downlink_.start();
  spawn_rtt_monitor(node_.runtime(), node_.log(), channels_.keyframe);
}

void EdgeSlamMobile::before_frame(Worker& worker, const OfferedFrame&) {
  downlink_.before_frame(worker);
}

void EdgeSlamMobile::after_frame(Worker& worker, const TrackedFrame& frame) {
  const double now_s = frame.offered.played.seq_s();
  if (frame.relocalised_now) relocalised_s_ = now_s;
  relocalisation_.after_frame(worker, frame);
  if (frame.outcome.state != TrackingState::kOk) return;
  // A restarted edge knows nothing: its map begins with a keyframe made at once.
  const PeerState edge = node_.network().peer();
  const bool edge_is_new = edge.connected && edge.incarnation != edge_incarnation_ &&
                           !frame.outcome.initialised_now;
  const KeyFrameNeed need =
      edge_is_new ? KeyFrameNeed::kUrgent : node_.tracker().keyframe_need();
  if (need == KeyFrameNeed::kNone) return;
  // A keyframe that the edge may still decline must not become the reference.
  const bool certain = need == KeyFrameNeed::kUrgent || frame.outcome.initialised_now;
  MapDelta made = node_.create_keyframe(worker, frame, need, certain);
  if (made.keyframes.empty()) return;
  downlink_.keyframe_created(worker.now());
  if (edge_is_new) {
    const std::array first{made.keyframes.front().id};
    made = node_.tracker().map()->read(
        [&](const MapView& view) { return extract_keyframes(view, first); });
    node_.log().write(JsonLine("edge_restarted")
                          .add("keyframe", first.front().value)
                          .add("incarnation", edge.incarnation));
  }
  if (edge_is_new || frame.outcome.initialised_now) edge_incarnation_ = edge.incarnation;
  uplink_.send(worker, frame, std::move(made),
               {.need = need,
                .first = frame.outcome.initialised_now || edge_is_new,
                .after_relocalisation =
                    relocalised_s_ >= 0 && now_s - relocalised_s_ < kAfterRelocalisationS,
                .applied_update = downlink_.applied_update(),
                .newest_edge_point = downlink_.newest_edge_point()});
}

void EdgeSlamMobile::finish(Worker& worker) { farewell_.say(worker, uplink_.last_sequence()); }

void EdgeSlamMobile::place_keyframes(PoseBook& book) {
  for (const KeyFramePose& pose : farewell_.poses()) book.placed(pose.id, pose.T_cw);
}

EdgeSlamEdge::EdgeSlamEdge(EdgeNode& node, const Parameters& parameters)
    : channels_(node.network(), parameters.integer("keyframe_queue")),
      mapping_(node, mapping_options(parameters), channels_.keyframe, channels_.map),
      relocalisation_(node, mapping_, channels_.frame, parameters.integer("n_kf"),
                      {.map_period = from_seconds(parameters.real("reloc_map_period_s")),
                       .max_candidates = parameters.integer("reloc_candidates"),
                       .covisibles = parameters.integer("reloc_covisibles")}),
      farewell_(node, channels_.control, mapping_,
                {.final_poses = parameters.boolean("final_poses")}) {}

void EdgeSlamEdge::start() {
  mapping_.start();
  relocalisation_.start();
  farewell_.start();
}

}  // namespace slambed
