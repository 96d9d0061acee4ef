// SPDX-License-Identifier: Apache-2.0
#include "dynnetslam/edge_contact.hpp"

#include <algorithm>

namespace slambed {
namespace {

constexpr std::uint64_t kMaxUnanswered = 4096;  ///< bytes

/// After this long without keyframes, the RTT is probed in every state.
constexpr Duration kKeyframesStopped = std::chrono::seconds(1);

}  // namespace

ContactOptions contact_options(const Parameters& parameters) {
  const std::string source = parameters.text("rtt_source");
  return {.link = {.source = source == "echo"      ? RttSource::kEcho
                             : source == "profile" ? RttSource::kProfile
                                                   : RttSource::kTcpInfo,
                   .missing = from_seconds(parameters.real("rtt_missing_s")),
                   .probe_hz = parameters.real("mes_probe_hz"),
                   .probe_bytes = parameters.integer("mes_probe_bytes")},
          .echo_hz = parameters.real("echo_hz")};
}

EdgeContact::EdgeContact(MobileNode& node, Channel& handover, Channel& keyframe,
                         const ContactOptions& options)
    : node_(node),
      channel_(handover),
      link_(node, keyframe, options.link),
      handover_(node, handover),
      inbox_(node.log()),
      echo_period_(from_seconds(1 / options.echo_hz)) {
  inbox_.on<wire::AckMessage>(wire::decode_ack,
                              [this](const wire::AckMessage& ack, const Message& raw) {
                                on_echo(ack.sequence, raw.received);
                              });
  inbox_.on<wire::HandoverAck>(wire::decode_handover_ack,
                               [this](const wire::HandoverAck& ack, const Message& raw) {
                                 on_ack(ack, raw.session, node_.runtime().now());
                               });
}

void EdgeContact::start() {
  node_.runtime().spawn("handover", [this](Worker& worker) { work(worker); });
}

void EdgeContact::announce(const wire::StateMessage& state, bool probed) {
  {
    std::lock_guard lock(mutex_);
    state_ = state;
    probing_ = probed;
  }
  changed_ = true;
  channel_.signal().notify();  // the worker sends it
}

void EdgeContact::keyframe_sent(RunTime now) {
  if (first_keyframe_.load() == kNever) first_keyframe_ = now;
  last_keyframe_ = now;
}

void EdgeContact::hand_over(std::uint64_t epoch, std::shared_ptr<Map> map) {
  std::lock_guard lock(mutex_);
  handover_.begin(epoch, std::move(map), edge_is_empty_.exchange(false));
}

void EdgeContact::work(Worker& worker) {
  RunTime next_state = worker.now();  // sent at once: the first decision needs an RTT
  while (!worker.stopping()) {
    const auto ticket = channel_.signal().ticket();
    while (const auto message = channel_.try_receive()) {
      link_.received(message->received);
      inbox_.dispatch(*message);
    }
    handover_.send_if_due(worker);
    const RunTime probe_due = probe(worker.now());
    const bool changed = changed_.exchange(false);
    if (changed || worker.now() >= next_state) {
      send_state(worker.now(), changed);
      next_state = worker.now() + echo_period_;
    }
    worker.wait(channel_.signal(), ticket, std::min(next_state, probe_due));
  }
}

void EdgeContact::send_state(RunTime now, bool changed) {
  const PathStats path = channel_.path();
  // Repetitions must not queue up for an edge that is away or does not read.
  if (!changed && (!path.connected || path.unacknowledged_bytes > kMaxUnanswered)) return;
  wire::StateMessage state;
  {
    std::lock_guard lock(mutex_);
    state = state_;
  }
  state.time = now;
  link_.asked(send(channel_, state), now);
}

RunTime EdgeContact::probe(RunTime now) {
  if (handing_over()) return kNever;  // it would queue behind the map, whose answer wakes us
  {
    std::lock_guard lock(mutex_);
    const RunTime idle = RunTime(last_keyframe_.load()) + kKeyframesStopped;
    if (!probing_ && now < idle) return idle;
  }
  return link_.probe(now);
}

void EdgeContact::on_echo(std::uint64_t sequence, RunTime received) {
  const auto sample = link_.answered(sequence, received);
  if (!sample || handing_over()) return;  // delayed by the map, not by the link
  link_.count(*sample);
  node_.log().write(JsonLine("rtt_sample")
                        .add("source", "echo")
                        .add("channel", channel_.options().name)
                        .add_ms("rtt_ms", *sample));
}

void EdgeContact::on_ack(const wire::HandoverAck& ack, std::uint64_t edge, RunTime now) {
  if (ack.answer != wire::HandoverAnswer::kNoMap) return handover_.acknowledged(ack, edge, now);
  std::lock_guard lock(mutex_);
  const RunTime first = RunTime(first_keyframe_.load());
  edge_is_empty_ = !handing_over() && ack.epoch == state_.epoch && now - link_.missing() > first;
}

}  // namespace slambed
