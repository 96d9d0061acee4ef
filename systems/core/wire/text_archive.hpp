// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <sstream>
#include <string>
#include <string_view>
#include <type_traits>

#include "wire/byte_io.hpp"

namespace slambed::wire {

/// Numbers as decimal text between blanks, written by an ordinary stream: what a portable text
/// archive of the Boost kind holds, and what it costs. Floats are scientific with as many digits
/// as bring them back exactly.
class TextWriter {
 public:
  TextWriter();
  template <typename T>
  void integer(T value) {
    static_assert(std::is_integral_v<T>);
    out_ << static_cast<std::int64_t>(value) << ' ';
  }
  void real(float value);
  void real(double value);
  /// Must not contain blanks.
  void word(std::string_view value) { out_ << value << ' '; }
  /// Any text, its length in front.
  void text(const std::string& value) { out_ << value.size() << ' ' << value << ' '; }
  std::string take() { return std::move(out_).str(); }

 private:
  std::ostringstream out_;
};

/// Reads what TextWriter wrote; whatever else comes along is a DecodeError.
class TextReader {
 public:
  explicit TextReader(std::string text);

  std::int64_t integer(std::int64_t low, std::int64_t high);
  bool flag() { return integer(0, 1) != 0; }
  float real32();
  double real64();
  void expect_word(std::string_view value);
  /// Number of following items of at least min_chars each: never more than what remains can hold.
  std::size_t count(std::size_t min_chars);
  std::string text();
  void expect_end();

 private:
  std::size_t remaining();
  void check() const;

  std::istringstream in_;
};

}  // namespace slambed::wire
