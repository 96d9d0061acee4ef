// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <initializer_list>
#include <stdexcept>
#include <string_view>

namespace slambed::wire {

/// Version of all payload layouts in this folder. Both nodes must have the same.
inline constexpr std::uint16_t kWireVersion = 9;
/// Version of put_delta's layout alone, which stored maps use too.
inline constexpr std::uint16_t kDeltaVersion = 4;

/// Message::type, a number from some MessageRange.
enum class MessageType : std::uint8_t {};

/// Returns the type as a message header contains it.
constexpr std::uint8_t type_of(MessageType type) { return static_cast<std::uint8_t>(type); }

/// Types from here on belong to the systems (System::messages), smaller ones to the core.
inline constexpr std::uint8_t kFirstOwnType = 128;

/// Message types that belong together, numbered from `first` in the order of their names. Numbers
/// are never reused: a removed type leaves an empty name.
class MessageRange {
 public:
  static constexpr std::size_t kMost = 16;

  consteval MessageRange(std::uint8_t first, std::initializer_list<std::string_view> names)
      : first_(first), count_(names.size()) {
    std::copy(names.begin(), names.end(), names_.begin());
  }
  /// Returns the type of this name. A name that is not in the range does not compile.
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
