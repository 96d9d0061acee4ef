// SPDX-License-Identifier: Apache-2.0
#include "multithread_rl/pose_requests.hpp"

#include "node/messaging.hpp"
#include "wire/message_type.hpp"

namespace slambed {
namespace {

/// An answer that takes longer is not worth waiting for: the camera is elsewhere by then.
constexpr Duration kPatience = std::chrono::seconds(2);

std::string_view name_of(wire::RelocFailure reason) {
  switch (reason) {
    case wire::RelocFailure::kNoMap:
      return "the edge has no map";
    case wire::RelocFailure::kUnreadable:
      return "the request could not be read";
    case wire::RelocFailure::kNotFound:
      break;
  }
  return "not found";
}

}  // namespace

MobileRelocalizationByPose::MobileRelocalizationByPose(MobileNode& node, Channel& frames,
                                                       Channel& control, Channel& keyframes,
                                                       MapDownlink& downlink, MessageCodec codec)
    : node_(node),
      frames_(frames),
      control_(control),
      keyframes_(keyframes),
      downlink_(downlink),
      codec_(std::move(codec)),
      requests_(node.runtime(), 1),
      answers_(node.runtime()) {}

void MobileRelocalizationByPose::start() {
  node_.runtime().spawn("reloc", [this](Worker& worker) { work(worker); });
}

void MobileRelocalizationByPose::work(Worker& worker) {
  while (!worker.stopping()) {
    const auto ticket = frames_.signal().ticket();
    if (const auto request = requests_.try_take()) {
      serialize(worker, *request);
    } else if (auto message = frames_.try_receive()) {
      parse(worker, std::move(*message));
    } else {
      worker.wait(frames_.signal(), ticket, kNever);
    }
  }
}

void MobileRelocalizationByPose::serialize(Worker& worker, const Request& request) {
  Bytes payload = codec_.serialize(worker, request.message);
  node_.log().write(JsonLine("reloc_request")
                        .add("number", request.message.number)
                        .add("frame", request.message.frame.frame_index)
                        .add("bytes", payload.size()));
  sent_bytes_ = payload.size();
  send(frames_, wire::RelocRequest::kType, std::move(payload));
  sent_ = worker.now();
}

void MobileRelocalizationByPose::parse(Worker& worker, Message message) {
  const bool ok = is(message, wire::RelocOk::kType);
  if (!ok && !is(message, wire::RelocFail::kType)) return;
  Answer answer;
  answer.sent = sent_;
  answer.request_bytes = sent_bytes_;
  answer.raw = std::move(message);
  answer.bytes = answer.raw.payload.size();
  const bool good = worker.stage(codec_.parse_stage(), [&](StageUnits& units) {
    units.n1 = ok ? kilobytes(answer.raw.payload) : 0;
    const auto read_well = read(node_.log(), answer.raw, [&](const Bytes& bytes) {
      if (ok) {
        answer.found =
            std::make_shared<const wire::RelocOk>(codec_.found(worker, bytes, node_.sensor()));
      } else {
        answer.failed = wire::decode_reloc_fail(bytes);
      }
      return true;
    });
    return read_well.has_value();
  });
  answer.raw.payload = {};
  if (good) answers_.put(std::move(answer));
}

void MobileRelocalizationByPose::before_frame(Worker& worker) {
  while (const auto answer = answers_.try_take()) on_answer(worker, *answer);
  if (!outstanding_) return;
  const PeerState edge = node_.network().peer();
  if (!edge.connected || edge.session != outstanding_->session) return give_up("edge away");
  if (worker.now() - outstanding_->asked >= kPatience) give_up("no answer");
}

void MobileRelocalizationByPose::give_up(std::string_view reason) {
  node_.log().write(
      JsonLine("reloc_given_up").add("number", outstanding_->message.number).add("reason", reason));
  outstanding_.reset();
}

void MobileRelocalizationByPose::on_answer(Worker& worker, const Answer& answer) {
  const wire::RelocOk* found = answer.found.get();
  const std::string_view foreign = unwanted(answer, found ? found->number : answer.failed.number);
  const std::string_view dropped = !foreign.empty() ? foreign
                                   : found          ? use(answer, *found)
                                                    : name_of(answer.failed.reason);
  record(worker, answer, found ? found->times : answer.failed.times, foreign.empty(), dropped);
  if (foreign.empty()) outstanding_.reset();
}

std::string_view MobileRelocalizationByPose::unwanted(const Answer& answer,
                                                      std::uint64_t number) const {
  if (answer.raw.session != node_.network().peer().session) return "its edge is gone";
  return outstanding_ && outstanding_->message.number == number ? "" : "not asked for";
}

std::string_view MobileRelocalizationByPose::use(const Answer& answer, const wire::RelocOk& found) {
  if (node_.tracker().state() != TrackingState::kLost) return "not lost any more";
  if (outstanding_->loss != losses_) return "of an earlier loss";
  const wire::FrameMessage& frame = outstanding_->message.frame;
  FoundFrame resumed{.index = frame.frame_index,
                     .timestamp_s = frame.timestamp_s,
                     .features = frame.features,
                     .T_cw = found.T_cw,
                     .reference = found.keyframe.keyframes.front().id,
                     .points = std::vector<MapPointId>(frame.features->size())};
  for (const auto& [feature, point] : found.matches) {
    if (feature >= resumed.points.size()) return "not of the frame";
    resumed.points[feature] = point;
  }
  downlink_.join(found.keyframe, found.update, answer.raw.session, found.jumped);
  found_ = node_.tracker().continue_from(resumed);
  return found_ ? "" : "its keyframe is not there";
}

void MobileRelocalizationByPose::record(Worker& worker, const Answer& answer,
                                        const wire::RelocTimes& times, bool ours,
                                        std::string_view dropped) {
  JsonLine event("reloc_reply");
  event.add("found", answer.found != nullptr)
      .add("used", dropped.empty())
      .add("bytes", answer.bytes);
  if (!dropped.empty()) event.add("reason", dropped);
  if (ours) {
    // Local timestamps give the local parts and the messages the others. They add up to the total
    // only if all belong to the same request.
    const Duration request = answer.sent - outstanding_->asked, up = times.received - times.queued,
                   at_edge = answer.raw.queued - times.received,
                   down = answer.raw.received - answer.raw.queued,
                   boundary = worker.now() - answer.raw.received,
                   total = worker.now() - outstanding_->asked;
    event.add("number", outstanding_->message.number)
        .add("frame", outstanding_->message.frame.frame_index)
        .add("request_bytes", answer.request_bytes)
        .add_ms("request_ms", request)
        .add_ms("up_ms", up)
        .add_ms("edge_ms", at_edge)
        .add_ms("down_ms", down)
        .add_ms("transfer_ms", up + down)
        .add_ms("boundary_ms", boundary)
        .add_ms("local_ms", request + boundary)
        .add_ms("total_ms", total)
        .add_ms("parts_error_ms",
                std::chrono::abs(total - (request + up + at_edge + down + boundary)));
  }
  node_.log().write(event);
}

void MobileRelocalizationByPose::before_tracking(
    Worker& worker, const OfferedFrame& frame, const std::shared_ptr<const FeatureSet>& features) {
  if (!lost_ || found_ || outstanding_ || node_.tracker().state() != TrackingState::kLost) return;
  const PeerState edge = node_.network().peer();
  if (!edge.connected) return;
  outstanding_ = Request{.message = {.number = ++requests_made_,
                                     .applied_update = downlink_.applied_update(),
                                     .frame = {.frame_index = frame.played.index,
                                               .timestamp_s = frame.played.seq_s(),
                                               .features = features}},
                         .asked = worker.now(),
                         .session = edge.session,
                         .loss = losses_};
  requests_.put(*outstanding_);
  frames_.signal().notify();
}

void MobileRelocalizationByPose::after_frame(Worker& worker, const TrackedFrame& frame) {
  const bool lost = frame.outcome.state == TrackingState::kLost;
  found_ = false;
  if (lost == lost_) return;
  lost_ = lost;
  downlink_.suspend(lost);
  keyframes_.hold(lost);
  if (lost) {
    ++losses_;
    send(control_, wire::SuspendMessage{losses_});
  } else {
    downlink_.recovered(worker.now(), frame.outcome.reference);
    send(control_, wire::ResumeMessage{losses_, frame.outcome.reference});
  }
  node_.log().write(JsonLine(lost ? "suspended" : "resumed")
                        .add("loss", losses_)
                        .add("frame", frame.offered.played.index)
                        .add("seq_s", frame.offered.played.seq_s()));
}

void MobileRelocalizationByPose::finish() {
  if (!lost_) return;
  keyframes_.hold(false);
  send(control_, wire::ResumeMessage{losses_, {}});
}

}  // namespace slambed
