// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/full_offload.hpp"

#include "offload/channels/rtt_monitor.hpp"

namespace slambed::edgeslam_semantic {
namespace {

TrackingServiceOptions service_options(const Parameters& parameters,
                                       const TrackerOptions& tracker) {
  TrackingServiceOptions options{
      .tracker = tracker, .loop_closing = parameters.boolean("loop_closing"), .masks = {}};
  if (parameters.boolean("nrcc")) {
    options.masks = {.threshold = parameters.real("n_m"),
                     .border_px = parameters.integer("mask_border_px"),
                     .floor = from_seconds(parameters.real("nrcc_floor_ms") / 1000)};
  }
  return options;
}

}  // namespace

OffloadedMobile::OffloadedMobile(MobileNode& node, const Parameters& parameters)
    : node_(node),
      control_(node.network().open({.name = "control", .heartbeat = true})),
      frames_(node.network().open(
          {.name = "frame", .send_queue = parameters.integer("picture_queue")})),
      tracking_(node, frames_, parameters.integer("offload_window")),
      shutdown_(node, control_) {}

void OffloadedMobile::start() {
  tracking_.start();
  spawn_rtt_monitor(node_.runtime(), node_.log(), frames_);
}

bool OffloadedMobile::offload(Worker& worker, const OfferedFrame& frame) {
  tracking_.send(worker, frame);
  return true;
}

void OffloadedMobile::finish(Worker& worker) {
  tracking_.drain(worker);
  shutdown_.shut_down(worker, tracking_.last_sequence());
}

void OffloadedMobile::place_keyframes(PoseBook& book) { shutdown_.place_keyframes(book); }

OffloadedEdge::OffloadedEdge(EdgeNode& node, const Parameters& parameters,
                             const TrackerOptions& tracker)
    : control_(node.network().open({.name = "control", .heartbeat = true})),
      frames_(node.network().open({.name = "frame"})),
      service_(node, frames_, service_options(parameters, tracker)),
      shutdown_(node, control_, service_, {}) {}

void OffloadedEdge::start() {
  service_.start();
  shutdown_.start();
}

}  // namespace slambed::edgeslam_semantic
