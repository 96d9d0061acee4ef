// SPDX-License-Identifier: Apache-2.0
#include "dynnetslam/link_estimator.hpp"

#include "base/error.hpp"
#include "node/messaging.hpp"
#include "wire/messages.hpp"

namespace slambed {
namespace {

constexpr int kSmoothing = 8;
/// Most unanswered messages that are remembered; older ones are given up.
constexpr std::size_t kMaxAsked = 64;

}  // namespace

LinkEstimator::LinkEstimator(MobileNode& node, Channel& measured, LinkOptions options)
    : node_(node), measured_(measured), options_(options) {
  if (options_.source == RttSource::kProfile && !node_.profile_rtt()) {
    throw bad_input("params.rtt_source: profile needs network.profile_rtt in run.json");
  }
}

std::optional<Duration> LinkEstimator::rtt(RunTime now) const {
  const bool alive = node_.network().peer().connected;
  if (!alive && now - RunTime(last_received_.load()) > options_.missing) return std::nullopt;
  if (options_.source == RttSource::kProfile) return node_.profile_rtt()->at(now);
  if (options_.source == RttSource::kEcho) {
    const Duration echo = echo_;
    return echo == Duration::min() ? std::nullopt : std::optional(echo);
  }
  const PathStats path = measured_.path();
  return path.connected ? path.smoothed_rtt : std::nullopt;
}

void LinkEstimator::asked(std::uint64_t sequence, RunTime sent) {
  asked_.emplace_back(sequence, sent);
  if (asked_.size() > kMaxAsked) asked_.pop_front();
}

std::optional<Duration> LinkEstimator::answered(std::uint64_t sequence, RunTime received) {
  while (!asked_.empty() && asked_.front().first < sequence) asked_.pop_front();
  if (asked_.empty() || asked_.front().first != sequence) return std::nullopt;
  const Duration sample = received - asked_.front().second;
  asked_.pop_front();
  return sample;
}

void LinkEstimator::count(Duration sample) {
  const Duration before = echo_;
  echo_ = before == Duration::min() ? sample : before + (sample - before) / kSmoothing;
}

RunTime LinkEstimator::probe(RunTime now) {
  if (options_.probe_hz <= 0) return kNever;
  if (now >= next_probe_) {
    next_probe_ = now + from_seconds(1 / options_.probe_hz);
    // Data in transit gives a sample too, and probes must not push messages out of their queue.
    if (measured_.path().unacknowledged_bytes == 0) {
      send(measured_, wire::kProbe, Bytes(static_cast<std::size_t>(options_.probe_bytes)));
    }
  }
  return next_probe_;
}

}  // namespace slambed
