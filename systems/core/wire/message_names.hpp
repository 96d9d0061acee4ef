// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>
#include <string_view>

#include "wire/message_type.hpp"

namespace slambed::wire {

/// What the types are called that a node may meet: the core's, and those of its system.
class MessageNames {
 public:
  /// Throws Error where two types have a number or a name in common, or `own` has the core's
  /// numbers.
  explicit MessageNames(std::span<const MessageRange> own = {});

  /// "KEYFRAME", "MAP_UPDATE" ...; "UNKNOWN" for numbers that name nothing.
  std::string_view operator[](std::uint8_t type) const;

 private:
  void add(const MessageRange& range, std::size_t least = 0);

  std::array<std::string_view, 256> names_{};
};

}  // namespace slambed::wire
