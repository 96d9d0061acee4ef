// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/remote_tracking.hpp"

#include <algorithm>

#include "node/messaging.hpp"
#include "wire/message_type.hpp"

namespace slambed {
namespace {

/// How long the mobile waits for the next answer before it gives up all frames in flight.
constexpr Duration kPatience = std::chrono::seconds(5);

TrackOutcome outcome_of(const wire::FrameResult& result) {
  constexpr auto state = [](wire::FrameState s) {
    return s == wire::FrameState::kOk     ? TrackingState::kOk
           : s == wire::FrameState::kLost ? TrackingState::kLost
                                          : TrackingState::kNotInitialized;
  };
  TrackOutcome outcome;
  outcome.state = state(result.state);
  outcome.reset_now = result.reset;
  outcome.T_cw = result.T_cw;
  outcome.reference = result.reference;
  outcome.T_cr = result.T_cr;
  outcome.inliers = static_cast<int>(result.inliers);
  return outcome;
}

}  // namespace

RemoteTracking::RemoteTracking(MobileNode& node, Channel& frames, int window)
    : node_(node),
      channel_(frames),
      window_(static_cast<std::uint64_t>(window)),
      answer_(node.runtime().make_signal()) {}

void RemoteTracking::start() {
  node_.runtime().spawn("results", [this](Worker& worker) { receive(worker); });
  node_.runtime().spawn("edge", [this](Worker& worker) { watch_edge(worker); });
}

/// Wakes the worker that waits for an answer whenever the edge connects or disconnects.
void RemoteTracking::watch_edge(Worker& worker) {
  Signal& changes = node_.network().peer_signal();
  while (!worker.stopping()) {
    const auto ticket = changes.ticket();
    answer_->notify();
    worker.wait(changes, ticket, kNever);
  }
}

void RemoteTracking::send(Worker& worker, const OfferedFrame& frame) {
  const std::uint64_t index = frame.played.index;
  wire::FrameImage message{.frame_index = index,
                           .timestamp_s = frame.played.seq_s(),
                           .captured = frame.offered,
                           .dequeued = frame.dequeued,
                           .jpeg = {}};
  message.jpeg = worker.stage("encode_image", [&](StageUnits& units) {
    auto jpeg = node_.images().jpeg(index);
    units.n1 = static_cast<double>(jpeg.size()) / 1000;
    return jpeg;
  });
  node_.log().write(JsonLine("frame_sent")
                        .add("frame", index)
                        .add("seq_s", message.timestamp_s)
                        .add("jpeg_bytes", message.jpeg.size()));
  const PeerState edge = node_.network().peer();
  sent_ = slambed::send(channel_, message);
  if (edge.connected) {
    sent_to_ = edge.session;
    sent_there_ = sent_;
  }
  if (window_ > 0) wait_for(worker, window_ - 1);
}

void RemoteTracking::wait_for(Worker& worker, std::uint64_t most_under_way) {
  std::uint64_t answered_before = answered_;
  RunTime deadline = worker.now() + kPatience;
  while (!worker.stopping()) {
    const auto ticket = answer_->ticket();
    give_up_lost();
    const std::uint64_t answered = answered_;
    if (sent_ <= answered + most_under_way) return;
    if (answered != answered_before) deadline = worker.now() + kPatience;
    answered_before = answered;
    if (worker.now() >= deadline) return give_up(sent_);
    worker.wait(*answer_, ticket, deadline);
  }
}

/// Gives up frames sent to an edge that was replaced. Frames queued in between go to the new one.
void RemoteTracking::give_up_lost() {
  const PeerState edge = node_.network().peer();
  if (edge.connected && edge.session != sent_to_) give_up(sent_there_);
}

void RemoteTracking::give_up(std::uint64_t last) {
  const std::uint64_t answered = answered_;
  if (last <= answered) return;
  node_.log().write(JsonLine("frames_unanswered").add("frames", last - answered));
  settle(last);
}

/// Raises answered_ atomically: answers arrive on one worker, another one gives frames up.
void RemoteTracking::settle(std::uint64_t upto) {
  std::uint64_t before = answered_;
  while (before < upto && !answered_.compare_exchange_weak(before, upto)) {
  }
}

void RemoteTracking::drain(Worker& worker) { wait_for(worker, 0); }

void RemoteTracking::receive(Worker& worker) {
  while (const auto message = channel_.receive(worker, kNever)) {
    if (!is(*message, wire::FrameResult::kType)) continue;
    on_result(*message);
    answer_->notify();
  }
}

void RemoteTracking::on_result(const Message& message) {
  const auto result = read(node_.log(), message, [this](const Bytes& bytes) {
    return wire::decode_frame_result(bytes, node_.sensor());
  });
  if (!result) return;
  settle(result->sequence);
  TrackOutcome outcome = outcome_of(*result);
  const bool ok = result->state == wire::FrameState::kOk;
  if (ok && edge_ != message.session) {
    // A restarted edge starts an empty map and reuses the ids of earlier keyframes.
    if (edge_ != 0) {
      outcome.reset_now = true;
      node_.log().write(JsonLine("edge_restarted")
                            .add("frame", result->frame_index)
                            .add("session", message.session));
    }
    edge_ = message.session;
  }
  node_.tracked_elsewhere(result->frame_index, outcome);
  if (ok) node_.poses().placed(result->reference, result->T_cr.inverse() * result->T_cw);
  record(*result, message.received, message.payload.size());
}

void RemoteTracking::record(const wire::FrameResult& result, RunTime arrived, std::size_t bytes) {
  const wire::FrameTimes& t = result.times;
  const Duration upload = t.begun - t.captured, download = arrived - t.done;
  const Duration inference = std::max(t.nrcc, t.extract) + t.track;
  const Duration parts = upload + inference + t.local_mapping + t.loop_closing + download;
  const Duration whole = arrived - t.captured;
  node_.log().write(JsonLine("frame_answered")
                        .add("frame", result.frame_index)
                        .add("ok", result.state == wire::FrameState::kOk)
                        .add("instances", result.masks.instances.size())
                        .add("bytes", bytes)
                        .add_ms("wait_ms", t.dequeued - t.captured)
                        .add_ms("encode_ms", t.queued - t.dequeued)
                        .add_ms("transport_ms", t.received - t.queued)
                        .add_ms("edge_wait_ms", t.begun - t.received)
                        .add_ms("upload_ms", upload)
                        .add_ms("nrcc_ms", t.nrcc)
                        .add_ms("extract_ms", t.extract)
                        .add_ms("track_ms", t.track)
                        .add_ms("inference_ms", inference)
                        .add_ms("local_mapping_ms", t.local_mapping)
                        .add_ms("loop_closing_ms", t.loop_closing)
                        .add_ms("download_ms", download)
                        .add_ms("transfer_ms", upload + download)
                        .add_ms("latency_ms", whole)
                        .add_ms("parts_error_ms", whole > parts ? whole - parts : parts - whole));
}

}  // namespace slambed
