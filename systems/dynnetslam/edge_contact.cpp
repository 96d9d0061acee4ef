// SPDX-License-Identifier: Apache-2.0
#include "dynnetslam/edge_contact.hpp"

#include <algorithm>

#include "base/error.hpp"
#include "map/map_snapshot.hpp"
#include "offload/map_sync.hpp"
#include "wire/message_type.hpp"

namespace slambed::dynnetslam {
namespace {

/// RFC 6298 and the kernel: a new sample counts an eighth.
constexpr int kSmoothing = 8;
/// Echoes that may be under way; older ones are given up.
constexpr std::size_t kMaxEchoes = 64;
constexpr std::uint64_t kMaxUnanswered = 4096;  ///< bytes

/// Without keyframes for so long the RTT is probed in every state.
constexpr Duration kKeyframesStopped = std::chrono::seconds(1);

constexpr auto type_of(wire::MessageType type) { return static_cast<std::uint8_t>(type); }

Duration period_of(double hz) { return from_seconds(1 / hz); }

}  // namespace

EdgeContact::EdgeContact(MobileNode& node, Channel& handover, Channel& keyframe,
                         ContactOptions options)
    : node_(node), channel_(handover), keyframe_channel_(keyframe), options_(options) {
  if (options_.source == RttSource::kProfile && !node_.profile_rtt()) {
    throw bad_input("params.rtt_source: profile needs network.profile_rtt in run.json");
  }
}

void EdgeContact::start() {
  node_.runtime().spawn("handover", [this](Worker& worker) { work(worker); });
}

std::optional<Duration> EdgeContact::rtt(RunTime now) const {
  const bool alive = node_.network().peer().connected;
  if (!alive && now - RunTime(heard_.load()) > options_.missing) return std::nullopt;
  if (options_.source == RttSource::kProfile) return node_.profile_rtt()->at(now);
  if (options_.source == RttSource::kEcho) {
    const Duration echo = echo_;
    return echo == Duration::min() ? std::nullopt : std::optional(echo);
  }
  const PathStats path = keyframe_channel_.path();
  return path.connected ? path.smoothed_rtt : std::nullopt;
}

void EdgeContact::tell(State state, std::uint64_t epoch, std::optional<Duration> rtt) {
  {
    std::lock_guard lock(mutex_);
    state_ = {.state = static_cast<std::uint8_t>(state), .epoch = epoch, .time = {}, .rtt = rtt};
    probing_ = state == State::kMobile;
  }
  news_ = true;
  channel_.signal().notify();  // the worker says it
}

void EdgeContact::stop(std::uint64_t epoch) {
  std::lock_guard lock(mutex_);
  map_.reset();
  handover_ = {};
  handing_over_ = false;
  channel_.send(type_of(wire::MessageType::kStop), encode(wire::StopMessage{epoch}));
}

void EdgeContact::keyframe_sent(RunTime now) {
  if (first_keyframe_.load() == kNever) first_keyframe_ = now;
  last_keyframe_ = now;
}

void EdgeContact::hand_over(std::uint64_t epoch, std::shared_ptr<Map> map) {
  {
    std::lock_guard lock(mutex_);
    if (edge_is_empty_.exchange(false)) known_ = {};
    map_ = std::move(map);
    handover_ = {};
    handover_.epoch = epoch;
    handover_.asked = node_.runtime().now();
    handing_over_ = true;
  }
  channel_.signal().notify();
}

void EdgeContact::received(std::shared_ptr<const Map> map) {
  auto content = std::make_shared<const MapDelta>(map->read(snapshot));
  const std::uint64_t edge = node_.network().peer().incarnation;
  std::lock_guard lock(mutex_);
  known_ = {std::move(map), std::move(content), edge};
  handover_.superseded = true;
}

void EdgeContact::work(Worker& worker) {
  RunTime next_state = worker.now();  // before the run begins: the first decision needs an RTT
  while (!worker.stopping()) {
    const auto ticket = channel_.signal().ticket();
    while (const auto message = channel_.try_receive()) take(*message, worker.now());
    hand_over_if_due(worker);
    const RunTime probe_due = probe_if_due(worker.now());
    const bool changed = news_.exchange(false);
    if (changed || worker.now() >= next_state) {
      say_state(worker.now(), changed);
      next_state = worker.now() + period_of(options_.echo_hz);
    }
    worker.wait(channel_.signal(), ticket, std::min(next_state, probe_due));
  }
}

void EdgeContact::say_state(RunTime now, bool changed) {
  const PathStats path = channel_.path();
  // Repetitions must not pile up before an edge that is away or does not listen.
  if (!changed && (!path.connected || path.unacknowledged_bytes > kMaxUnanswered)) return;
  wire::StateMessage state;
  {
    std::lock_guard lock(mutex_);
    state = state_;
  }
  state.time = now;
  const auto sequence = channel_.send(type_of(wire::MessageType::kState), encode(state));
  echoes_.emplace_back(sequence, now);
  if (echoes_.size() > kMaxEchoes) echoes_.pop_front();
}

RunTime EdgeContact::probe_if_due(RunTime now) {
  if (options_.probe_hz <= 0) return kNever;
  if (handing_over_) return kNever;  // it would wait behind the map; its answer wakes us
  {
    std::lock_guard lock(mutex_);
    const RunTime idle = RunTime(last_keyframe_.load()) + kKeyframesStopped;
    if (!probing_ && now < idle) return idle;
  }
  if (now >= next_probe_) {
    next_probe_ = now + period_of(options_.probe_hz);
    // What is under way gives a sample too; probes must not crowd keyframes out of their queue.
    if (keyframe_channel_.path().unacknowledged_bytes == 0) {
      keyframe_channel_.send(type_of(wire::MessageType::kProbe),
                             Bytes(static_cast<std::size_t>(options_.probe_bytes)));
    }
  }
  return next_probe_;
}

/// A connection delivers what it was given, however long that takes. Only a new one, or another edge,
/// is a reason to send a hand-over again.
void EdgeContact::hand_over_if_due(Worker& worker) {
  const PathStats path = channel_.path();
  if (!path.connected) return;  // wakes us when it is
  const std::uint64_t edge = node_.network().peer().incarnation;
  Handover handover;
  Known known;
  {
    std::lock_guard lock(mutex_);
    if (!map_) return;
    if (handover_.under_way && handover_.known.edge == edge) {
      if (handover_.connection != path.connections) send_handover(handover_);
      return;
    }
    handover_.number = ++handovers_;
    handover_.under_way = true;
    handover_.known = {map_, nullptr, edge};
    handover = handover_;
    known = known_.edge == edge ? known_ : Known();
  }
  prepare_handover(worker, std::move(handover), std::move(known));
}

void EdgeContact::prepare_handover(Worker& worker, Handover handover, Known known) {
  wire::MapHandover message{.epoch = handover.epoch,
                            .number = handover.number,
                            .whole = known.map != handover.known.map,
                            .changes = {}};
  worker.stage("prepare_update", [&](StageUnits& units) {
    handover.known.map->read([&](const MapView& view) {
      handover.known.content = std::make_shared<const MapDelta>(snapshot(view));
      const MapDelta& now = *handover.known.content;
      message.changes = message.whole ? now : changes_since(*known.content, now, view);
    });
    message.changes.epoch = handover.epoch;
    units.n1 = static_cast<double>(message.changes.keyframes.size());
    units.n2 = static_cast<double>(message.changes.points.size());
    return 0;
  });
  const bool start = !message.whole && message.changes.empty();
  handover.type = type_of(start ? wire::MessageType::kStart : wire::MessageType::kMapHandover);
  handover.payload = worker.stage("serialise", [&](StageUnits& units) {
    Bytes bytes = start ? encode(wire::StartMessage{handover.epoch, handover.number})
                        : encode(message);
    units.n1 = static_cast<double>(bytes.size()) / 1000;
    return bytes;
  });
  {
    std::lock_guard lock(mutex_);
    if (handover_.number != handover.number) return;  // stopped meanwhile
    handover.superseded = handover_.superseded;
    handover_ = handover;
    send_handover(handover_);
  }
  node_.log().write(JsonLine("handover_sent")
                        .add("epoch", handover.epoch)
                        .add("number", handover.number)
                        .add("whole", message.whole)
                        .add("keyframes", message.changes.keyframes.size())
                        .add("points", message.changes.points.size())
                        .add("bytes", handover.payload.size()));
}

void EdgeContact::send_handover(Handover& handover) {
  handover.connection = channel_.path().connections;
  channel_.send(handover.type, handover.payload);
}

void EdgeContact::take(const Message& message, RunTime now) {
  heard_ = message.received;
  try {
    if (message.type == type_of(wire::MessageType::kAck)) {
      take_echo(wire::decode_ack(message.payload).sequence, message.received);
    } else if (message.type == type_of(wire::MessageType::kHandoverAck)) {
      take_ack(wire::decode_handover_ack(message.payload), message.incarnation, now);
    }
  } catch (const wire::DecodeError& error) {
    node_.log().warning(std::string("answer of the edge refused: ") + error.what());
  }
}

void EdgeContact::take_echo(std::uint64_t sequence, RunTime received) {
  while (!echoes_.empty() && echoes_.front().first < sequence) echoes_.pop_front();
  if (echoes_.empty() || echoes_.front().first != sequence) return;
  const Duration sample = received - echoes_.front().second;
  echoes_.pop_front();
  if (handing_over_) return;  // waited behind the map
  const Duration before = echo_;
  echo_ = before == Duration::min() ? sample : before + (sample - before) / kSmoothing;
  node_.log().write(JsonLine("rtt_sample")
                        .add("source", "echo")
                        .add("channel", channel_.options().name)
                        .add_ms("rtt_ms", sample));
}

void EdgeContact::take_ack(const wire::HandoverAck& ack, std::uint64_t edge, RunTime now) {
  JsonLine event("handover_acknowledged");
  event.add("epoch", ack.epoch).add("number", ack.number).add("accepted", ack.accepted);
  {
    std::lock_guard lock(mutex_);
    if (ack.number == 0) {
      const RunTime first = RunTime(first_keyframe_.load());
      edge_is_empty_ = !map_ && ack.epoch == state_.epoch && now - options_.missing > first;
      return;
    }
    const bool current = handover_.under_way && ack.number == handover_.number;
    if (!map_ || ack.epoch != handover_.epoch || edge != handover_.known.edge) {
      event.add("stale", true);
    } else if (ack.accepted) {
      event.add_ms("handover_ms", now - handover_.asked);
      if (!handover_.superseded) known_ = current ? std::move(handover_.known) : Known();
      handover_ = {};
      map_.reset();
      handing_over_ = false;
    } else if (current) {
      known_ = {};  // the edge has lost its map: all of it, at once
      handover_.under_way = false;
    }
  }
  node_.log().write(event);
}

}  // namespace slambed::dynnetslam
