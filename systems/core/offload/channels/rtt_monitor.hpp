// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "node/event_log.hpp"
#include "runtime/channel.hpp"
#include "runtime/runtime.hpp"

namespace slambed {

/// Logs the RTT that the transport of the channel measures, ten times a second.
void spawn_rtt_monitor(Runtime& runtime, EventLog& log, const Channel& channel);

}  // namespace slambed
