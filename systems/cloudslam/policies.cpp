// SPDX-License-Identifier: Apache-2.0
#include "cloudslam/policies.hpp"

#include "cloudslam/cloudslam.hpp"
#include "node/messaging.hpp"
#include "offload/channels/rtt_monitor.hpp"
#include "wire/message_type.hpp"

namespace slambed::cloudslam {
namespace {

/// The paper uploads overnight over cheap Wi-Fi at home; a run cannot wait that long.
constexpr Duration kUploadPatience = std::chrono::minutes(5);

}  // namespace

Vehicle::Vehicle(MobileNode& node, const Parameters& parameters)
    : node_(node),
      strategy_(strategy_options(parameters)),
      sending_(strategy_.begin()),
      align_gap_s_(1 / parameters.real("align_rate_hz")),
      align_timeout_s_(parameters.real("align_timeout_s")),
      control_(node.network().open({.name = "control", .heartbeat = true})),
      keyframes_(node.network().open(
          {.name = "keyframe", .send_queue = parameters.integer("keyframe_queue")})),
      uploads_(node.network().open({.name = "upload"})),
      upload_(parameters.boolean("upload")),
      mapping_(node.runtime(), node.log(), mapper_options(parameters), node.tracker().map(),
               IdSpace::kMobileMapper, LocalMapping::Mode::kWorker),
      poses_(node, mapping_,
             {.window_s = parameters.real("window_s"),
              .graded = parameters.text("back_propagation") == "graded"}),
      sender_(node, keyframes_, message_codec(parameters),
              static_cast<std::size_t>(parameters.integer("keyframe_bytes"))),
      uploader_(node, uploads_, message_codec(parameters), 0),
      shutdown_(node, control_) {}

void Vehicle::start() {
  mapping_.start();
  sender_.start();
  if (upload_) uploader_.start();
  spawn_rtt_monitor(node_.runtime(), node_.log(), keyframes_);
  if (strategy_.adapts()) report_distance(0);
}

void Vehicle::change(State state) {
  constexpr auto name = [](State s) {
    return s == State::kAlign ? "ALIGN" : s == State::kTrip ? "TRIP" : "UPLOAD";
  };
  node_.log().write(JsonLine("state_changed").add("from", name(state_)).add("to", name(state)));
  state_ = state;
}

void Vehicle::report_distance(double seq_s) {
  node_.log().write(
      JsonLine("distance_threshold").add("seq_s", seq_s).add("distance_m", sending_.distance_m));
}

void Vehicle::before_frame(Worker& worker, const OfferedFrame& frame) {
  const double seq_s = frame.played.seq_s();
  while (const auto message = keyframes_.try_receive()) {
    const bool initial = is(*message, wire::kInitialPose);
    if (!initial && !is(*message, wire::kPoseUpdate)) continue;
    // Several keyframes may be in transit for alignment; only the first answer is used.
    if (initial != (state_ == State::kAlign) || align_failed_) continue;
    if (const auto correction = poses_.apply(worker, *message, initial, seq_s))
      corrected(*correction, initial, seq_s);
  }
}

void Vehicle::corrected(const PoseCorrection& correction, bool aligned, double seq_s) {
  if (at_w_) at_w_ = correction.T_new_old * *at_w_;  // a correction is not travel
  if (aligned) {
    node_.log().write(JsonLine("trip_aligned")
                          .add("keyframe", correction.keyframe.value)
                          .add("seq_s", seq_s)
                          .add("align_s", seq_s - first_s_.value_or(seq_s)));
    change(State::kTrip);
  } else if (strategy_.adapts()) {
    sending_ = strategy_.answered(sending_, correction.magnitude_m);
    report_distance(seq_s);
  }
}

/// Starts over after a track loss in a young map, including the alignment of the trip.
void Vehicle::reset(Worker& worker) {
  const auto map = node_.tracker().map();
  mapping_.reset(map).wait(worker);
  map->clear();  // also of what the mapper committed before its reset
  first_s_.reset();
  if (state_ == State::kTrip) change(State::kAlign);
}

void Vehicle::travel(const TrackedFrame& frame) {
  if (frame.outcome.state != TrackingState::kOk) {
    at_w_.reset();
    return;
  }
  const Eigen::Vector3d here = frame.outcome.T_cw.inverse().t;
  if (at_w_) traveled_m_ += (here - *at_w_).norm();
  at_w_ = here;
}

void Vehicle::after_frame(Worker& worker, const TrackedFrame& frame) {
  if (frame.outcome.reset_now) reset(worker);
  travel(frame);
  if (frame.outcome.state != TrackingState::kOk ||
      !node_.tracker().wants_keyframe(mapping_.status()))
    return;
  const MapDelta made = node_.create_keyframe(worker, frame, node_.tracker().keyframe_need(), true);
  for (const NewKeyFrame& keyframe : made.keyframes) {
    send_if_due(frame, keyframe.id);
    mapping_.submit(worker, keyframe.id);
  }
}

void Vehicle::send_if_due(const TrackedFrame& frame, KeyFrameId keyframe) {
  const Moment moment{frame.offered.played.seq_s(), traveled_m_};
  const bool first = !first_s_;
  if (first) {
    first_s_ = moment.seq_s;
    align_failed_ = false;
  }
  auto type = wire::kKeyFrame;
  std::string_view reason = "strategy";
  if (state_ == State::kAlign) {
    if (!first && moment.seq_s - *first_s_ > align_timeout_s_ && !align_failed_) {
      align_failed_ = true;
      node_.log().write(JsonLine("align_failed").add("seq_s", moment.seq_s));
    }
    if (align_failed_ || (!first && moment.seq_s - align_sent_s_ < align_gap_s_)) return;
    align_sent_s_ = moment.seq_s;
    type = wire::kTripStart;
    reason = first ? "trip_start" : "align";
  } else if (!strategy_.next(sending_, moment)) {
    return;
  }
  sending_ = Strategy::sent(sending_, moment);
  sender_.send(type, keyframe, frame.offered.offered,
               JsonLine("keyframe_sent")
                   .add("keyframe", keyframe.value)
                   .add("seq_s", moment.seq_s)
                   .add("traveled_m", moment.traveled_m)
                   .add("reason", reason));
}

void Vehicle::finish(Worker& worker) {
  sender_.written().wait(worker);
  mapping_.drained().wait(worker);
  if (upload_ && state_ == State::kTrip) upload(worker);
  shutdown_.shut_down(worker, sender_.last_sequence());
}

/// Uploads all keyframes of the trip in their current state; the edge skips those it already has.
void Vehicle::upload(Worker& worker) {
  change(State::kUpload);
  const auto keyframes =
      node_.tracker().map()->read([](const MapView& view) { return view.keyframe_ids(); });
  for (const KeyFrameId id : keyframes)
    uploader_.send(wire::kKeyFrame, id, worker.now(),
                   JsonLine("keyframe_uploaded").add("keyframe", id.value));
  uploader_.written().wait(worker);
  send(uploads_, wire::kTripUpload);
  const RunTime deadline = worker.now() + kUploadPatience;
  while (const auto message = uploads_.receive(worker, deadline))
    if (is(*message, wire::kTripUpload)) return;
  node_.log().warning("the edge did not say that the whole trip came");
}

void Vehicle::place_keyframes(PoseBook& book) { book.placed_in(*node_.tracker().map()); }

Edge::Edge(EdgeNode& node, const Parameters& parameters)
    : control_(node.network().open({.name = "control", .heartbeat = true})),
      keyframes_(node.network().open({.name = "keyframe"})),
      uploads_(node.network().open({.name = "upload"})),
      upload_(parameters.boolean("upload")),
      mapping_(node, keyframes_, remote_mapping_options(parameters)),
      trip_(node, uploads_, message_codec(parameters)),
      shutdown_(node, control_, mapping_, {.final_poses = false}) {}

void Edge::start() {
  mapping_.start();
  if (upload_) trip_.start();
  shutdown_.start();
}

void Edge::leave(const std::filesystem::path& folder) {
  if (upload_) trip_.leave(*mapping_.map(), mapping_.places(), mapping_.info(), folder);
}

}  // namespace slambed::cloudslam
