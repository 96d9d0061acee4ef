// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <iosfwd>

namespace slambed {

/// Sends a trace of messages up the modeled link, over one connection and without nodes, and writes
/// when each arrives. `slambed link messages` compares the result with a real link
/// (docs/reference/run-folder.md, "Message trace"). Throws bad_input for an invalid trace.
void play_message_trace(const std::filesystem::path& trace, std::ostream& arrivals);

}  // namespace slambed
