// SPDX-License-Identifier: Apache-2.0
#include "wire/text_archive.hpp"

#include <limits>
#include <locale>

namespace slambed::wire {

TextWriter::TextWriter() {
  out_.imbue(std::locale::classic());
  out_ << std::scientific;
}

void TextWriter::real(float value) {
  out_.precision(std::numeric_limits<float>::max_digits10);
  out_ << value << ' ';
}

void TextWriter::real(double value) {
  out_.precision(std::numeric_limits<double>::max_digits10);
  out_ << value << ' ';
}

TextReader::TextReader(std::string text) : in_(std::move(text)) {
  in_.imbue(std::locale::classic());
}

void TextReader::check() const {
  if (!in_) throw DecodeError("text archive is damaged or cut");
}

std::int64_t TextReader::integer(std::int64_t low, std::int64_t high) {
  std::int64_t value = 0;
  in_ >> value;
  check();
  if (value < low || value > high) throw DecodeError("number is out of range");
  return value;
}

// A stream accepts neither "inf" nor "nan", and fails where a number is too large.
float TextReader::real32() {
  float value = 0;
  in_ >> value;
  check();
  return value;
}

double TextReader::real64() {
  double value = 0;
  in_ >> value;
  check();
  return value;
}

void TextReader::expect_word(std::string_view value) {
  std::string word;
  in_.width(static_cast<std::streamsize>(value.size() + 1));
  in_ >> word;
  check();
  if (word != value) throw DecodeError("text archive: '" + std::string(value) + "' is missing");
}

std::size_t TextReader::remaining() {
  const std::streamsize left = in_.rdbuf()->in_avail();
  return left > 0 ? static_cast<std::size_t>(left) : 0;
}

std::size_t TextReader::count(std::size_t min_chars) {
  const std::int64_t value = integer(0, std::numeric_limits<std::int64_t>::max());
  const auto count = static_cast<std::size_t>(value);
  if (count > remaining() / min_chars) throw DecodeError("count is larger than the message");
  return count;
}

std::string TextReader::text() {
  std::string value(count(1), '\0');
  in_.get();  // the blank
  in_.read(value.data(), static_cast<std::streamsize>(value.size()));
  check();
  return value;
}

void TextReader::expect_end() {
  expect_word("end");
  if (in_.get() != ' ' || remaining() != 0) throw DecodeError("bytes behind the message");
}

}  // namespace slambed::wire
