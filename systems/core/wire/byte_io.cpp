// SPDX-License-Identifier: Apache-2.0
#include "wire/byte_io.hpp"

#include <bit>
#include <cmath>

#include "base/run_time_range.hpp"

namespace slambed::wire {

void ByteWriter::f32(float value) { u32(std::bit_cast<std::uint32_t>(value)); }

void ByteWriter::f64(double value) { u64(std::bit_cast<std::uint64_t>(value)); }

void ByteWriter::varint(std::uint64_t value) {
  while (value >= 0x80) {
    bytes_.push_back(static_cast<std::uint8_t>(value) | 0x80);
    value >>= 7;
  }
  bytes_.push_back(static_cast<std::uint8_t>(value));
}

void ByteWriter::zigzag(std::int64_t value) {
  varint((static_cast<std::uint64_t>(value) << 1) ^ static_cast<std::uint64_t>(value >> 63));
}

void ByteWriter::text(const std::string& value) {
  varint(value.size());
  bytes_.insert(bytes_.end(), value.begin(), value.end());
}

std::span<const std::uint8_t> ByteReader::take(std::size_t size) {
  if (size > remaining()) throw DecodeError("message ends too early");
  const auto part = bytes_.subspan(at_, size);
  at_ += size;
  return part;
}

std::uint64_t ByteReader::fixed(std::size_t size) {
  const auto part = take(size);
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < size; ++i) value |= static_cast<std::uint64_t>(part[i]) << (8 * i);
  return value;
}

float ByteReader::f32() {
  const float value = std::bit_cast<float>(u32());
  if (!std::isfinite(value)) throw DecodeError("number is not finite");
  return value;
}

double ByteReader::f64() {
  const double value = std::bit_cast<double>(u64());
  if (!std::isfinite(value)) throw DecodeError("number is not finite");
  return value;
}

std::uint64_t ByteReader::varint() {
  std::uint64_t value = 0;
  for (int shift = 0; shift < 64; shift += 7) {
    const std::uint8_t byte = u8();
    const std::uint64_t bits = byte & 0x7f;
    if (shift == 63 && bits > 1) break;
    value |= bits << shift;
    if ((byte & 0x80) == 0) return value;
  }
  throw DecodeError("integer is too long");
}

std::uint32_t ByteReader::varint32() {
  const std::uint64_t value = varint();
  if (value > UINT32_MAX) throw DecodeError("integer is out of range");
  return static_cast<std::uint32_t>(value);
}

RunTime ByteReader::time() {
  const std::int64_t ns = i64();
  if (!is_run_time(ns)) throw DecodeError("time is out of range");
  return RunTime(ns);
}

std::int64_t ByteReader::zigzag() {
  const std::uint64_t value = varint();
  return static_cast<std::int64_t>((value >> 1) ^ (~(value & 1) + 1));
}

std::string ByteReader::text(std::size_t max_length) {
  const std::size_t length = count(1);
  if (length > max_length) throw DecodeError("text is too long");
  const auto part = take(length);
  return {part.begin(), part.end()};
}

bool ByteReader::flag() {
  const std::uint8_t value = u8();
  if (value > 1) throw DecodeError("flag is neither 0 nor 1");
  return value == 1;
}

std::size_t ByteReader::count(std::size_t min_bytes) {
  const std::uint64_t value = varint();
  if (value > remaining() / min_bytes) throw DecodeError("count exceeds the message");
  return static_cast<std::size_t>(value);
}

void ByteReader::expect_end() const {
  if (remaining() != 0) throw DecodeError("bytes are left over");
}

}  // namespace slambed::wire
