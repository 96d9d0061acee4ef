// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>

#include "base/time.hpp"
#include "link/direction.hpp"
#include "runtime/virtual/simulator.hpp"

namespace slambed {

/// One direction of the emulated link in virtual time. It uses the model that the relay applies to
/// real packets (DirectionModel::admit): packet loss, then bandwidth with its queue, delay and
/// jitter, gaps. Packets are not reordered.
class PathModel {
 public:
  /// direction: 0 up, 1 down, as the relay numbers its random streams.
  PathModel(Simulator& simulator, const link::DirectionOptions& options, std::uint64_t seed,
            std::uint64_t direction);

  /// Calls on_arrival when the packet arrives, or never if it is dropped.
  void transmit(std::uint32_t bytes, std::function<void()> on_arrival);
  /// The profile's delay now, without queueing and jitter.
  Duration delay_now() const;
  std::uint64_t dropped() const { return dropped_; }

 private:
  Simulator& simulator_;
  link::DirectionModel model_;
  std::uint64_t dropped_ = 0;
};

}  // namespace slambed
