// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include "base/time.hpp"
#include "runtime/runtime.hpp"

namespace slambed {

/// A live stage that takes the time of a device's cost model (live/pace.hpp).
struct PacedStage {
  Duration charged{};   ///< duration from the cost model
  Duration work{};      ///< CPU time of the work itself, without the burned time
  bool missed = false;  ///< the work alone took longer than the model allows
};

struct StageRecord {
  std::string_view name, worker;
  RunTime start{};
  Duration wall{}, cpu{};
  StageUnits units;
  std::optional<PacedStage> paced{};
};

/// A message that the receiver took, or that a full queue on either side dropped.
struct MessageRecord {
  std::string_view channel;
  bool incoming = false;
  bool dropped = false;
  std::uint8_t type = 0;
  std::size_t bytes = 0;  ///< payload and header
  std::uint64_t sequence = 0;
  RunTime queued{}, sent{}, received{};
};

/// A change of a connection: connected, lost, reconnected, rejected; on the channel with the
/// heartbeat also silent and alive; stalled and flowing (StallWatch).
struct ConnectionEvent {
  std::string_view channel, event, detail;
};

/// Receives the reports of runtimes and channels, from any thread.
class Observer {
 public:
  virtual ~Observer() = default;
  virtual void stage(const StageRecord& record) = 0;
  virtual void message(const MessageRecord& record) = 0;
  virtual void link(const ConnectionEvent& record) = 0;
  /// Reports that a message of this type could not be decoded.
  virtual void refused(std::uint8_t type, std::string_view why) = 0;
};

}  // namespace slambed
