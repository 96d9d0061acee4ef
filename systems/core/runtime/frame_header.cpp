// SPDX-License-Identifier: Apache-2.0
#include "runtime/frame_header.hpp"

#include <zlib.h>

#include "base/run_time_range.hpp"

namespace slambed {
namespace {

template <typename T>
std::uint8_t* put(std::uint8_t* at, T value) {
  const auto bits = static_cast<std::uint64_t>(value);
  for (std::size_t i = 0; i < sizeof(T); ++i) *at++ = static_cast<std::uint8_t>(bits >> (8 * i));
  return at;
}

template <typename T>
const std::uint8_t* get(const std::uint8_t* at, T& value) {
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < sizeof(T); ++i) bits |= static_cast<std::uint64_t>(*at++) << (8 * i);
  value = static_cast<T>(bits);
  return at;
}

}  // namespace

std::uint32_t checksum(std::span<const std::uint8_t> bytes) {
  return static_cast<std::uint32_t>(crc32_z(crc32_z(0, nullptr, 0), bytes.data(), bytes.size()));
}

std::array<std::uint8_t, FrameHeader::kSize> FrameHeader::encode() const {
  std::array<std::uint8_t, kSize> bytes{};
  std::uint8_t* at = bytes.data();
  at = put(at, kMagic);
  at = put(at, kVersion);
  at = put(at, type);
  at = put(at, flags);
  at = put(at, sequence);
  at = put(at, static_cast<std::int64_t>(queued.count()));
  at = put(at, static_cast<std::int64_t>(sent.count()));
  at = put(at, length);
  at = put(at, payload_crc);
  put(at, checksum(std::span(bytes).first<kSize - 4>()));
  return bytes;
}

std::variant<FrameHeader, std::string> FrameHeader::decode(
    std::span<const std::uint8_t, kSize> bytes) {
  FrameHeader header;
  std::uint32_t magic = 0, own_crc = 0;
  std::uint16_t version = 0;
  std::int64_t queued_ns = 0, sent_ns = 0;
  const std::uint8_t* at = bytes.data();
  at = get(at, magic);
  if (magic != kMagic) return std::string("not a slambed message");
  at = get(at, version);
  if (version != kVersion) return "frame version " + std::to_string(version) + ", not 1";
  at = get(at, header.type);
  at = get(at, header.flags);
  at = get(at, header.sequence);
  at = get(at, queued_ns);
  at = get(at, sent_ns);
  at = get(at, header.length);
  at = get(at, header.payload_crc);
  get(at, own_crc);
  if (own_crc != checksum(bytes.first<kSize - 4>())) return std::string("header checksum is wrong");
  if (!is_run_time(queued_ns) || !is_run_time(sent_ns)) return std::string("time is out of range");
  header.queued = RunTime(queued_ns);
  header.sent = RunTime(sent_ns);
  return header;
}

}  // namespace slambed
