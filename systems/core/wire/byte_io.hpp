// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/time.hpp"

namespace slambed::wire {

using Bytes = std::vector<std::uint8_t>;

/// The bytes are not a valid message. Decoders throw no other exception.
class DecodeError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Appends little-endian values. varint() writes LEB128.
class ByteWriter {
 public:
  void u8(std::uint8_t value) { bytes_.push_back(value); }
  void u16(std::uint16_t value) { fixed(value); }
  void u32(std::uint32_t value) { fixed(value); }
  void u64(std::uint64_t value) { fixed(value); }
  void i64(std::int64_t value) { fixed(static_cast<std::uint64_t>(value)); }
  void f32(float value);
  void f64(double value);
  void varint(std::uint64_t value);
  /// Zigzag-maps the value, so that small magnitudes of either sign become short varints.
  void zigzag(std::int64_t value);
  void time(RunTime value) { i64(value.count()); }
  void text(const std::string& value);
  void reserve(std::size_t more) { bytes_.reserve(bytes_.size() + more); }
  std::size_t size() const { return bytes_.size(); }
  Bytes take() { return std::move(bytes_); }

 private:
  template <typename T>
  void fixed(T value) {
    for (std::size_t i = 0; i < sizeof(T); ++i) {
      bytes_.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
    }
  }
  Bytes bytes_;
};

/// Reads what ByteWriter wrote. Every read is bounds-checked, and floats must be finite.
class ByteReader {
 public:
  explicit ByteReader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  std::uint8_t u8() { return take(1)[0]; }
  std::uint16_t u16() { return static_cast<std::uint16_t>(fixed(2)); }
  std::uint32_t u32() { return static_cast<std::uint32_t>(fixed(4)); }
  std::uint64_t u64() { return fixed(8); }
  std::int64_t i64() { return static_cast<std::int64_t>(fixed(8)); }
  float f32();
  double f64();
  std::uint64_t varint();
  std::uint32_t varint32();
  std::int64_t zigzag();
  /// Refuses times beyond kMaxRunTime, so that arithmetic on the result cannot overflow.
  RunTime time();
  std::string text(std::size_t max_length);
  /// A boolean written as u8 0 or 1.
  bool flag();
  /// Returns the number of items that follow, each at least min_bytes long. A count that the
  /// remaining bytes cannot hold is refused, so that a forged count cannot cause an allocation.
  std::size_t count(std::size_t min_bytes);
  std::span<const std::uint8_t> take(std::size_t size);
  std::size_t remaining() const { return bytes_.size() - at_; }
  /// Throws DecodeError if bytes are left over.
  void expect_end() const;

 private:
  std::uint64_t fixed(std::size_t size);
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
};

}  // namespace slambed::wire
