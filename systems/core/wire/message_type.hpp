// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <initializer_list>
#include <stdexcept>
#include <string_view>

namespace slambed::wire {

/// Version of every payload layout below this folder; both nodes must have the same.
inline constexpr std::uint16_t kWireVersion = 9;
/// Version of put_delta's layout alone, which stored maps have too.
inline constexpr std::uint16_t kDeltaVersion = 4;

/// Message::type: a number of some MessageRange.
enum class MessageType : std::uint8_t {};

/// As it stands in a message's header.
constexpr std::uint8_t type_of(MessageType type) { return static_cast<std::uint8_t>(type); }

/// From here on types are the systems' own (System::messages), below the core's.
inline constexpr std::uint8_t kFirstOwnType = 128;

/// Types that belong together, declared where their structs are: numbers from the first on, one for
/// each name. Numbers are never reused: a type that goes leaves an empty name behind.
class MessageRange {
 public:
  static constexpr std::size_t kMost = 16;

  consteval MessageRange(std::uint8_t first, std::initializer_list<std::string_view> names)
      : first_(first), count_(names.size()) {
    std::copy(names.begin(), names.end(), names_.begin());
  }
  /// The type of this name; a name that is not of the range does not compile.
  consteval MessageType operator[](std::string_view name) const {
    for (std::size_t i = 0; i < count_; ++i) {
      if (names_[i] == name) return MessageType(first_ + i);
    }
    throw std::logic_error("no message of this range has the name");
  }
  constexpr std::uint8_t first() const { return first_; }
  constexpr std::size_t count() const { return count_; }
  constexpr std::string_view name(std::size_t index) const { return names_[index]; }

 private:
  std::uint8_t first_;
  std::size_t count_;
  std::array<std::string_view, kMost> names_{};
};

}  // namespace slambed::wire
