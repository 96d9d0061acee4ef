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

/// How text is made and read. The time that streams need is part of what such an archive stands
/// for; where a model charges for it anyway, the same text is had directly, an order of magnitude
/// faster.
enum class TextMeans : std::uint8_t { kStreams, kDirect };

/// Numbers as decimal text between blanks: what a portable text archive of the Boost kind holds,
/// and by streams also what it costs. Floats are scientific with as many digits as bring them back
/// exactly.
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
  /// Any text, its length in front.
  void text(const std::string& value);
  /// What another writer has taken.
  void add(std::string_view written);
  std::string take();

 private:
  void put(std::int64_t value);

  std::optional<std::ostringstream> stream_;
  std::string direct_;
};

/// Reads what TextWriter wrote; whatever else comes along is a DecodeError.
class TextReader {
 public:
  TextReader(std::string text, TextMeans means);

  std::int64_t integer(std::int64_t low, std::int64_t high);
  bool flag() { return integer(0, 1) != 0; }
  float real32();
  double real64();
  void expect_word(std::string_view value);
  /// Number of following items of at least min_chars each: never more than what remains can hold.
  std::size_t count(std::size_t min_chars);
  std::string text();
  void expect_end();

  /// What has not been read, and going on in it; direct only.
  std::string_view rest() const { return std::string_view(direct_).substr(at_); }
  void skip(std::size_t chars) { at_ += chars; }
  void skip_blanks();

 private:
  template <typename Number>
  Number number();
  std::size_t remaining();
  /// The next character, or none.
  std::optional<char> character();

  std::optional<std::istringstream> stream_;
  std::string direct_;
  std::size_t at_ = 0;  ///< in direct_
};

}  // namespace slambed::wire
