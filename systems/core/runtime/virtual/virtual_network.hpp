// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <deque>
#include <map>
#include <memory>
#include <string>

#include "runtime/network.hpp"
#include "runtime/observer.hpp"
#include "runtime/virtual/path_model.hpp"
#include "runtime/virtual/tcp_flow.hpp"
#include "runtime/virtual/virtual_runtime.hpp"

namespace slambed {

/// The link of a virtual run. All channels share one path per direction; each is a separate TCP
/// connection, as in the live network.
class VirtualLink {
 public:
  VirtualLink(Simulator& simulator, const link::DirectionOptions& up,
              const link::DirectionOptions& down, std::uint64_t seed);
  ~VirtualLink();

  /// The network as one node sees it. The observer gets the same reports as from live channels.
  Network& mobile_side(Observer& observer);
  Network& edge_side(Observer& observer);

  /// Freezes or resumes the edge's program. Meanwhile its kernel receives and acknowledges data.
  /// After kPeerSilence the mobile finds the edge silent.
  void freeze_edge(bool frozen);

  /// RTT of a small packet now, without queueing.
  Duration rtt_now() const { return up_.delay_now() + down_.delay_now(); }
  const PathModel& up() const { return up_; }
  const PathModel& down() const { return down_; }

 private:
  class Side;
  class VirtualChannel;
  Side& side(int index, Observer& observer);
  void connect(const std::string& name);
  void hear(int listener, bool silent);
  void watch_gaps(const link::DirectionOptions& direction, int listener);

  Simulator& simulator_;
  PathModel up_, down_;
  std::array<std::unique_ptr<Side>, 2> sides_;  ///< mobile, edge
  int freezes_ = 0;                             ///< number of freeze_edge calls so far
  bool frozen_silent_ = false;                  ///< the mobile finds the frozen edge silent
};

}  // namespace slambed
