// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>

#include "base/time.hpp"
#include "link/direction.hpp"
#include "runtime/virtual/simulator.hpp"

namespace slambed {

/// One direction of the emulated link in virtual time. What happens to a packet is decided by the
/// very model that the relay applies to real ones: packet loss, then bandwidth with its queue,
/// delay and jitter, gaps (DirectionModel::admit). Packets keep their order.
class PathModel {
 public:
  /// direction: 0 up, 1 down, as the relay numbers its streams of random numbers.
  PathModel(Simulator& simulator, const link::DirectionOptions& options, std::uint64_t seed,
            std::uint64_t direction);

  /// Calls on_arrival when the packet comes out at the other end; never when it is lost.
  void transmit(std::uint32_t bytes, std::function<void()> on_arrival);
  /// The profile's delay now, as a lone packet would see it.
  Duration delay_now() const;
  std::uint64_t dropped() const { return dropped_; }

 private:
  Simulator& simulator_;
  link::DirectionModel model_;
  std::uint64_t dropped_ = 0;
};

}  // namespace slambed
