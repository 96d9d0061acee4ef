// SPDX-License-Identifier: Apache-2.0
#include "apps/relay/pipe.hpp"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include "apps/relay/clock.hpp"
#include "base/error.hpp"

namespace slambed::relay {
namespace {

constexpr std::int64_t kHeldBytesLimit = 256LL
                                         << 20;  // 1 Gbit/s for 2 s; beyond, memory is at risk
constexpr std::size_t kSpareBuffers = 4096;

// IPv4 (RFC 791) and ICMP (RFC 792) headers.
constexpr std::size_t kShortestIpv4 = 20;
constexpr std::uint8_t kProtocolIcmp = 1;
constexpr std::uint8_t kEchoReply = 0, kEchoRequest = 8;

/// Returns the (big-endian) sequence number of an ICMP echo, or 0 for any other packet.
std::uint16_t echo_sequence(std::span<const std::uint8_t> packet) {
  const std::size_t header = 4U * (packet[0] & 0x0fU);
  if (packet[9] != kProtocolIcmp || packet.size() < header + 8) return 0;
  const std::uint8_t type = packet[header];
  if (type != kEchoReply && type != kEchoRequest) return 0;
  return static_cast<std::uint16_t>(packet[header + 6] << 8 | packet[header + 7]);
}

}  // namespace

Pipe::Pipe(const DirectionOptions& options, std::uint64_t seed, std::uint8_t direction, int from,
           int to, PacketLog& log)
    : model_(options, seed, direction), direction_(direction), from_(from), to_(to), log_(log) {}

int Pipe::take(int budget, std::span<std::uint8_t> buffer) {
  int taken = 0;
  while (taken < budget) {
    const ssize_t size = read(from_, buffer.data(), buffer.size());
    if (size < 0) {
      if (errno == EAGAIN || errno == EINTR) break;
      throw Error(ExitCode::kPeer, std::string("a device of the link went away: ") +
                                       std::strerror(errno) + ", " +
                                       (direction_ == 0 ? "mobile" : "edge") +
                                       " side, leave the devices alone while the link runs");
    }
    ++taken;
    accept(buffer.first(static_cast<std::size_t>(size)));
  }
  return taken;
}

void Pipe::accept(std::span<const std::uint8_t> packet) {
  if (packet.size() < kShortestIpv4 || packet[0] >> 4 != 4) return;  // the link carries only IPv4
  const std::int64_t now_ns = monotonic_ns();
  const auto size = static_cast<std::uint32_t>(packet.size());
  const std::uint16_t tag = echo_sequence(packet);
  const auto lane = tag != 0 ? link::Lane::kProbe : link::Lane::kData;
  std::deque<Held>& held = held_[static_cast<std::size_t>(lane)];
  PacketOutcome outcome = model_.admit(now_ns, size, lane);
  if (outcome.fate == Fate::kDelivered && held_bytes_ + size > kHeldBytesLimit) {
    outcome.fate = Fate::kOverflow;
  }
  PacketRecord record{};
  record.in_ns = now_ns;
  record.profile_ns = outcome.profile_ns;
  record.queue_bytes =
      static_cast<std::uint32_t>(std::min<std::int64_t>(outcome.queue_bytes, UINT32_MAX));
  record.bytes = size;
  record.tag = tag;
  record.direction = direction_;
  record.fate = static_cast<std::uint8_t>(outcome.fate);
  record.protocol = packet[9];
  ++counters_.packets;
  counters_.bytes += size;
  ++counters_.fates[record.fate];
  if (outcome.fate != Fate::kDelivered) {
    log_.append(record);
    return;
  }
  record.due_ns = outcome.due_ns;
  if (held.empty() && record.due_ns <= now_ns) {
    hand_over(record, packet);
    return;
  }
  held.push_back({record, copy(packet)});
  held_bytes_ += size;
  counters_.held_bytes_max = std::max(counters_.held_bytes_max, held_bytes_);
}

std::vector<std::uint8_t> Pipe::copy(std::span<const std::uint8_t> packet) {
  std::vector<std::uint8_t> bytes;
  if (!spare_.empty()) {
    bytes = std::move(spare_.back());
    spare_.pop_back();
  }
  bytes.assign(packet.begin(), packet.end());
  return bytes;
}

void Pipe::deliver_due() {
  for (auto& lane : held_) deliver_due(lane);
}

void Pipe::deliver_due(std::deque<Held>& lane) {
  while (!lane.empty() && lane.front().record.due_ns <= monotonic_ns()) {
    Held& first = lane.front();
    hand_over(first.record, first.bytes);
    held_bytes_ -= static_cast<std::int64_t>(first.bytes.size());
    if (spare_.size() < kSpareBuffers) spare_.push_back(std::move(first.bytes));
    lane.pop_front();
  }
}

void Pipe::hand_over(PacketRecord& record, std::span<const std::uint8_t> packet) {
  record.out_ns = monotonic_ns();
  if (write(to_, packet.data(), packet.size()) < 0) ++counters_.write_errors;
  counters_.late_ns_max = std::max(counters_.late_ns_max, record.out_ns - record.due_ns);
  log_.append(record);
}

}  // namespace slambed::relay
