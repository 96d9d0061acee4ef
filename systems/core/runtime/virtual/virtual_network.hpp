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

/// The link of a virtual run: one path per direction, shared by all channels, each of which is a
/// TCP connection of its own, as in the live network.
class VirtualLink {
 public:
  VirtualLink(Simulator& simulator, const link::DirectionOptions& up,
              const link::DirectionOptions& down, std::uint64_t seed);
  ~VirtualLink();

  /// The network as one node sees it. Observers get what the live channels report.
  Network& mobile_side(Observer& observer);
  Network& edge_side(Observer& observer);

  /// The edge's program stands still, or goes on: what arrives meanwhile waits in its kernel, which
  /// acknowledges it. Once that has lasted for kPeerSilence the mobile misses its signs of life.
  void freeze_edge(bool frozen);

  /// Round trip that a small packet would see now, without queueing.
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
  int freezes_ = 0;                             ///< beginnings and ends so far
  bool frozen_silent_ = false;                  ///< the mobile misses the edge's signs of life
};

}  // namespace slambed
