// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <iosfwd>

namespace slambed {

/// Sends a given trace of messages up the modeled link, over one connection and without any node,
/// and writes when each arrived: what `slambed link messages` compares with a real link
/// (docs/reference/run-folder.md). bad_input for a file that is not one.
void play_message_trace(const std::filesystem::path& trace, std::ostream& arrivals);

}  // namespace slambed
