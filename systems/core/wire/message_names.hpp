// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>
#include <string_view>

#include "wire/message_type.hpp"

namespace slambed::wire {

/// Names of the message types that a node may receive: those of the core and of its system.
class MessageNames {
 public:
  /// Throws Error if two types share a number or a name, or if `own` uses a number of the core.
  explicit MessageNames(std::span<const MessageRange> own = {});

  /// Returns "KEYFRAME", "MAP_UPDATE" ..., or "UNKNOWN" for a number without a name.
  std::string_view operator[](std::uint8_t type) const;

 private:
  void add(const MessageRange& range, std::size_t least = 0);

  std::array<std::string_view, 256> names_{};
};

}  // namespace slambed::wire
