// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>

#include "base/time.hpp"

namespace slambed {

/// The header of every message on a byte stream. Little-endian, 44 bytes:
/// magic u32, version u16, type u8, flags u8, sequence u64, queued i64, sent i64, length u32,
/// payload crc32 u32, crc32 of the first 40 bytes u32.
struct FrameHeader {
  static constexpr std::size_t kSize = 44;
  static constexpr std::uint32_t kMagic = 0x44424C53;  // "SLBD"
  static constexpr std::uint16_t kVersion = 1;
  static constexpr std::uint8_t kGreetingFlag = 1;  ///< first frame on every connection
  static constexpr std::uint8_t kCloseFlag = 2;     ///< last frame: the sender closes
  static constexpr std::uint8_t kAliveFlag = 4;     ///< heartbeat without a message

  std::uint8_t type = 0;
  std::uint8_t flags = 0;
  std::uint64_t sequence = 0;
  RunTime queued{}, sent{};
  std::uint32_t length = 0;
  std::uint32_t payload_crc = 0;

  bool greeting() const { return (flags & kGreetingFlag) != 0; }
  bool closes() const { return (flags & kCloseFlag) != 0; }
  bool alive() const { return (flags & kAliveFlag) != 0; }
  std::array<std::uint8_t, kSize> encode() const;
  /// Returns the header, or the reason why the bytes are not a valid one.
  static std::variant<FrameHeader, std::string> decode(std::span<const std::uint8_t, kSize> bytes);
};

std::uint32_t checksum(std::span<const std::uint8_t> bytes);

}  // namespace slambed
