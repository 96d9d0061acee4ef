// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include "base/time.hpp"
#include "runtime/runtime.hpp"

namespace slambed {

/// A stage of a live run that takes what a device's model charges (live/pace.hpp).
struct PacedStage {
  Duration charged{};   ///< what the model says
  Duration work{};      ///< CPU time of the work itself; the rest of the stage's was burnt
  bool missed = false;  ///< the work alone took longer than the model says
};

/// One finished stage of a worker.
struct StageRecord {
  std::string_view name, worker;
  RunTime start{};
  Duration wall{}, cpu{};
  StageUnits units;
  std::optional<PacedStage> paced{};
};

/// The end of a message's life: taken by the receiver, or dropped from a full queue on either side.
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

/// Where runtimes and channels report what happened. Called from any thread.
class Observer {
 public:
  virtual ~Observer() = default;
  virtual void stage(const StageRecord& record) = 0;
  virtual void message(const MessageRecord& record) = 0;
  virtual void link(const ConnectionEvent& record) = 0;
  /// A message of this type could not be read.
  virtual void refused(std::uint8_t type, std::string_view why) = 0;
};

}  // namespace slambed
