// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>
#include <type_traits>

#include "wire/byte_io.hpp"

namespace slambed::wire {

/// How text is written and read. Streams take the time that Edge-SLAM's archives take. Where a cost
/// model charges for that time, the same text is made directly, an order of magnitude faster.
enum class TextMeans : std::uint8_t { kStreams, kDirect };

/// Writes numbers as decimal text separated by blanks, as a Boost text archive does. Floats are in
/// scientific notation with enough digits to be restored exactly.
class TextWriter {
 public:
  explicit TextWriter(TextMeans means);
  template <typename T>
  void integer(T value) {
    static_assert(std::is_integral_v<T>);
    put(static_cast<std::int64_t>(value));
  }
  void real(float value);
  void real(double value);
  /// Must not contain blanks.
  void word(std::string_view value);
  /// Writes any text after its length.
  void text(const std::string& value);
  /// Appends the output of another writer.
  void add(std::string_view written);
  std::string take();

 private:
  void put(std::int64_t value);

  std::optional<std::ostringstream> stream_;
  std::string direct_;
};

/// Reads what TextWriter wrote. Throws DecodeError for anything else.
class TextReader {
 public:
  TextReader(std::string text, TextMeans means);

  std::int64_t integer(std::int64_t low, std::int64_t high);
  bool flag() { return integer(0, 1) != 0; }
  float real32();
  double real64();
  void expect_word(std::string_view value);
  /// Returns the number of items that follow, each at least min_chars long. Throws DecodeError for
  /// a count that the remaining text cannot hold.
  std::size_t count(std::size_t min_chars);
  std::string text();
  void expect_end();

  /// The text not read yet, and skipping in it; with TextMeans::kDirect only.
  std::string_view rest() const { return std::string_view(direct_).substr(at_); }
  void skip(std::size_t chars) { at_ += chars; }
  void skip_blanks();

 private:
  template <typename Number>
  Number number();
  std::size_t remaining();
  /// Returns the next character, or nothing at the end.
  std::optional<char> character();

  std::optional<std::istringstream> stream_;
  std::string direct_;
  std::size_t at_ = 0;  ///< in direct_
};

}  // namespace slambed::wire
