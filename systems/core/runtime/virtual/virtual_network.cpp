// SPDX-License-Identifier: Apache-2.0
#include "runtime/virtual/virtual_network.hpp"

#include <algorithm>
#include <utility>

#include "base/error.hpp"
#include "runtime/message_queue.hpp"
#include "runtime/message_record.hpp"
#include "runtime/stall_watch.hpp"

namespace slambed {
namespace {

/// A message is handed over while TCP has fewer unsent bytes (live: TCP_NOTSENT_LOWAT).
constexpr std::uint64_t kUnsentLimit = 128 * 1024;
/// Nodes are not restarted in a virtual run.
constexpr std::uint64_t kOnlySession = 1;

}  // namespace

class VirtualLink::VirtualChannel final : public Channel {
 public:
  VirtualChannel(Simulator& simulator, Observer& observer, ChannelOptions options)
      : simulator_(simulator), observer_(observer), options_(std::move(options)) {}

  /// Connects this end to the peer's. The handshake gives the first RTT sample.
  void connect(VirtualChannel& peer, PathModel& outward, PathModel& inward) {
    flow_ = std::make_unique<TcpFlow>(
        simulator_, outward, inward, [&peer](std::uint64_t upto) { peer.receive_upto(upto); },
        [this] { acknowledged(); });
    peer_ = &peer;
    flow_->start(outward.delay_now() + inward.delay_now());
    record_link("connected");
    hand_over();
    signal_.notify();
  }

  const ChannelOptions& options() const override { return options_; }

  std::uint64_t send(std::uint8_t type, Bytes payload) override {
    if (payload.size() > options_.max_payload) {
      throw Error(ExitCode::kInternal, "channel " + options_.name + ": message of " +
                                           std::to_string(payload.size()) +
                                           " bytes is over the limit; raise max_payload");
    }
    Message message;
    message.type = type;
    message.sequence = next_sequence_++;
    message.queued = simulator_.now();
    message.payload = std::move(payload);
    const std::uint64_t sequence = message.sequence;
    auto dropped = push_drop_oldest(outgoing_, std::move(message), options_.send_queue);
    if (dropped) record(*dropped, false, true);
    hand_over();
    return sequence;
  }

  void hold(bool held) override {
    held_ = held;
    hand_over();
  }

  std::optional<Message> try_receive() override {
    if (incoming_.empty()) return std::nullopt;
    Message message = std::move(incoming_.front());
    incoming_.pop_front();
    record(message, true, false);
    return message;
  }

  Signal& signal() override { return signal_; }

  PathStats path() const override {
    PathStats stats;
    stats.connected = flow_ != nullptr;
    stats.connections = flow_ ? 1 : 0;
    if (flow_) {
      stats.smoothed_rtt = flow_->smoothed_rtt();
      stats.unacknowledged_bytes = flow_->unacknowledged();
    }
    return stats;
  }

  /// Freezes or resumes the program; the kernel's TCP goes on meanwhile.
  void freeze(bool frozen) {
    frozen_ = frozen;
    if (frozen) return;
    receive_upto(arrived_);
    hand_over();
  }

  void record_link(std::string_view event, std::string_view detail = "") const {
    observer_.link({.channel = options_.name, .event = event, .detail = detail});
  }

 private:
  void hand_over() {
    while (!frozen_ && !held_ && flow_ && !outgoing_.empty() && flow_->unsent() < kUnsentLimit) {
      Message message = std::move(outgoing_.front());
      outgoing_.pop_front();
      message.sent = simulator_.now();
      const std::uint64_t bytes = size_on_wire(message);
      peer_->expected_ += bytes;
      peer_->under_way_.emplace_back(peer_->expected_, std::move(message));
      if (flow_->unacknowledged() == 0) stall_.progress(simulator_.now());
      flow_->write(bytes);
      watch_stall();
    }
  }

  void acknowledged() {
    if (const auto lasted = stall_.progress(simulator_.now())) {
      record_link("flowing", StallWatch::end_detail(*lasted));
    }
    watch_stall();
    hand_over();
  }

  /// Schedules a check for when a stall would be due, as long as bytes are in flight.
  void watch_stall() {
    if (watching_ || stall_.stalled()) return;
    watching_ = true;
    simulator_.at_background(stall_.due(), [this] {
      watching_ = false;
      if (flow_->unacknowledged() == 0) return;
      if (stall_.stalls(simulator_.now())) {
        record_link("stalled", StallWatch::begin_detail());
      } else {
        watch_stall();
      }
    });
  }

  void receive_upto(std::uint64_t upto) {
    arrived_ = upto;
    bool arrived = false;
    while (!frozen_ && !under_way_.empty() && under_way_.front().first <= upto) {
      Message message = std::move(under_way_.front().second);
      under_way_.pop_front();
      message.received = simulator_.now();
      message.session = kOnlySession;
      auto dropped = push_drop_oldest(incoming_, std::move(message), options_.receive_queue);
      if (dropped) record(*dropped, true, true);
      arrived = true;
    }
    if (arrived) signal_.notify();
  }

  void record(const Message& m, bool incoming, bool dropped) const {
    observer_.message(record_of(m, options_.name, incoming, dropped));
  }

  Simulator& simulator_;
  Observer& observer_;
  ChannelOptions options_;
  VirtualSignal signal_;
  VirtualChannel* peer_ = nullptr;
  std::unique_ptr<TcpFlow> flow_;
  std::deque<Message> outgoing_, incoming_;
  std::deque<std::pair<std::uint64_t, Message>> under_way_;  ///< to us, with end in the byte stream
  std::uint64_t expected_ = 0;
  std::uint64_t arrived_ = 0;  ///< bytes of the stream that the kernel has received
  bool frozen_ = false;
  bool held_ = false;
  std::uint64_t next_sequence_ = 1;
  StallWatch stall_;
  bool watching_ = false;
};

class VirtualLink::Side final : public Network {
 public:
  Side(VirtualLink& link, Observer& observer) : link_(link), observer_(observer) {}

  Channel& open(const ChannelOptions& options) override {
    auto [slot, added] = channels_.try_emplace(options.name);
    if (!added) throw Error(ExitCode::kInternal, "channel " + options.name + " is opened twice");
    slot->second = std::make_unique<VirtualChannel>(link_.simulator_, observer_, options);
    link_.connect(options.name);
    return *slot->second;
  }

  PeerState peer() const override {
    const bool met = !channels_.empty() &&
                     std::all_of(channels_.begin(), channels_.end(), [](const auto& channel) {
                       return channel.second->path().connected;
                     });
    return {.connected = met && silences_ == 0, .session = met ? kOnlySession : 0};
  }
  Signal& peer_signal() override { return peer_signal_; }
  void freeze(bool frozen) {
    for (const auto& [name, channel] : channels_) channel->freeze(frozen);
  }
  void hear(bool silent) {
    const int before = std::exchange(silences_, silences_ + (silent ? 1 : -1));
    if (before != 0 && silences_ != 0) return;
    peer_signal_.notify();
    for (const auto& [name, channel] : channels_) {
      if (channel->options().heartbeat) channel->record_link(silent ? "silent" : "alive");
    }
  }

  VirtualChannel* find(const std::string& name) const {
    const auto slot = channels_.find(name);
    return slot == channels_.end() ? nullptr : slot->second.get();
  }

 private:
  VirtualLink& link_;
  Observer& observer_;
  VirtualSignal peer_signal_;
  int silences_ = 0;  ///< current reasons why the peer is silent: gaps, a frozen edge
  std::map<std::string, std::unique_ptr<VirtualChannel>> channels_;
};

VirtualLink::VirtualLink(Simulator& simulator, const link::DirectionOptions& up,
                         const link::DirectionOptions& down, std::uint64_t seed)
    : simulator_(simulator), up_(simulator, up, seed, 0), down_(simulator, down, seed, 1) {
  watch_gaps(up, 1);
  watch_gaps(down, 0);
}

VirtualLink::~VirtualLink() = default;

VirtualLink::Side& VirtualLink::side(int index, Observer& observer) {
  if (!sides_[index]) sides_[index] = std::make_unique<Side>(*this, observer);
  return *sides_[index];
}

/// During a long gap in one direction, the receiving side finds its peer silent.
void VirtualLink::watch_gaps(const link::DirectionOptions& direction, int listener) {
  for (const link::Gap& gap : direction.gaps) {
    const RunTime noticed = RunTime(gap.start_ns) + kPeerSilence, over(gap.end_ns);
    if (over <= noticed) continue;
    for (const bool silent : {true, false}) {
      simulator_.at_background(silent ? noticed : over,
                               [this, listener, silent] { hear(listener, silent); });
    }
  }
}

void VirtualLink::hear(int listener, bool silent) {
  if (sides_[listener]) sides_[listener]->hear(silent);
}

void VirtualLink::freeze_edge(bool frozen) {
  const int mine = ++freezes_;
  if (sides_[1]) sides_[1]->freeze(frozen);
  if (frozen) {
    simulator_.at_background(simulator_.now() + kPeerSilence, [this, mine] {
      if (mine == freezes_) {
        hear(0, true);
        frozen_silent_ = true;
      }
    });
  } else if (std::exchange(frozen_silent_, false)) {
    hear(0, false);
  }
}

Network& VirtualLink::mobile_side(Observer& observer) { return side(0, observer); }
Network& VirtualLink::edge_side(Observer& observer) { return side(1, observer); }

void VirtualLink::connect(const std::string& name) {
  if (!sides_[0] || !sides_[1]) return;
  VirtualChannel* mobile = sides_[0]->find(name);
  VirtualChannel* edge = sides_[1]->find(name);
  if (!mobile || !edge) return;
  mobile->connect(*edge, up_, down_);
  edge->connect(*mobile, down_, up_);
  for (const auto& side : sides_) side->peer_signal().notify();
}

}  // namespace slambed
