// SPDX-License-Identifier: Apache-2.0
#include "wire/text_archive.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <locale>
#include <utility>

namespace slambed::wire {
namespace {

constexpr std::size_t kLongestNumber = 32;  ///< "-1.12345678901234567e-308"

template <typename... Format>
void append(std::string& text, Format... value_and_format) {
  std::array<char, kLongestNumber> digits;
  const auto end =
      std::to_chars(digits.data(), digits.data() + digits.size(), value_and_format...).ptr;
  text.append(digits.data(), end);
  text.push_back(' ');
}

/// Writes max_digits10 digits after the point, as a stream with std::scientific does.
template <typename Float>
void put_real(std::optional<std::ostringstream>& stream, std::string& direct, Float value) {
  constexpr int kDigits = std::numeric_limits<Float>::max_digits10;
  if (!stream) return append(direct, value, std::chars_format::scientific, kDigits);
  stream->precision(kDigits);
  *stream << value << ' ';
}

DecodeError damaged() { return DecodeError("text archive is damaged or cut"); }

}  // namespace

TextWriter::TextWriter(TextMeans means) {
  if (means == TextMeans::kDirect) return;
  stream_.emplace();
  stream_->imbue(std::locale::classic());
  *stream_ << std::scientific;
}

void TextWriter::put(std::int64_t value) {
  if (!stream_) return append(direct_, value);
  *stream_ << value << ' ';
}

void TextWriter::real(float value) { put_real(stream_, direct_, value); }
void TextWriter::real(double value) { put_real(stream_, direct_, value); }

void TextWriter::word(std::string_view value) {
  if (stream_)
    *stream_ << value << ' ';
  else
    direct_.append(value).push_back(' ');
}

void TextWriter::text(const std::string& value) {
  integer(value.size());
  word(value);
}

void TextWriter::add(std::string_view written) {
  if (stream_)
    *stream_ << written;
  else
    direct_.append(written);
}

std::string TextWriter::take() { return stream_ ? std::move(*stream_).str() : std::move(direct_); }

TextReader::TextReader(std::string text, TextMeans means) {
  if (means == TextMeans::kDirect) {
    direct_ = std::move(text);
    return;
  }
  stream_.emplace(std::move(text));
  stream_->imbue(std::locale::classic());
}

void TextReader::skip_blanks() {
  while (at_ < direct_.size() && direct_[at_] == ' ') ++at_;
}

template <typename Number>
Number TextReader::number() {
  Number value = 0;
  if (stream_) {
    *stream_ >> value;
    if (!*stream_) throw damaged();
    return value;
  }
  skip_blanks();
  const char* end = direct_.data() + direct_.size();
  const auto [rest, error] = std::from_chars(direct_.data() + at_, end, value);
  // As a stream, refuse "inf", "nan" and numbers that are too large.
  if (error != std::errc() || !std::isfinite(static_cast<double>(value))) throw damaged();
  at_ = static_cast<std::size_t>(rest - direct_.data());
  return value;
}

std::int64_t TextReader::integer(std::int64_t low, std::int64_t high) {
  const auto value = number<std::int64_t>();
  if (value < low || value > high) throw DecodeError("number is out of range");
  return value;
}

float TextReader::real32() { return number<float>(); }
double TextReader::real64() { return number<double>(); }

void TextReader::expect_word(std::string_view value) {
  std::string word;
  if (stream_) {
    stream_->width(static_cast<std::streamsize>(value.size() + 1));
    *stream_ >> word;
    if (!*stream_) throw damaged();
  } else {
    skip_blanks();
    while (at_ < direct_.size() && direct_[at_] != ' ' && word.size() <= value.size())
      word.push_back(direct_[at_++]);
  }
  if (word != value) throw DecodeError("text archive: '" + std::string(value) + "' is missing");
}

std::size_t TextReader::remaining() {
  if (!stream_) return direct_.size() - at_;
  const std::streamsize left = stream_->rdbuf()->in_avail();
  return left > 0 ? static_cast<std::size_t>(left) : 0;
}

std::size_t TextReader::count(std::size_t min_chars) {
  const std::int64_t value = integer(0, std::numeric_limits<std::int64_t>::max());
  const auto count = static_cast<std::size_t>(value);
  if (count > remaining() / min_chars) throw DecodeError("count is larger than the message");
  return count;
}

std::optional<char> TextReader::character() {
  if (remaining() == 0) return std::nullopt;
  return stream_ ? static_cast<char>(stream_->get()) : direct_[at_++];
}

std::string TextReader::text() {
  const std::size_t size = count(1);
  character();  // the blank
  if (remaining() < size) throw damaged();
  std::string value(size, '\0');
  if (stream_)
    stream_->read(value.data(), static_cast<std::streamsize>(size));
  else
    value = direct_.substr(std::exchange(at_, at_ + size), size);
  return value;
}

void TextReader::expect_end() {
  expect_word("end");
  if (character() != ' ' || remaining() != 0) throw DecodeError("bytes behind the message");
}

}  // namespace slambed::wire
