// SPDX-License-Identifier: Apache-2.0
#include "node/json_line.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>

namespace slambed {
namespace {

/// Length of the UTF-8 sequence at the start of text; 0 if invalid.
std::size_t utf8_length(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char lead = byte(0);
  const std::size_t length = lead < 0x80   ? 1
                             : lead < 0xC2 ? 0
                             : lead < 0xE0 ? 2
                             : lead < 0xF0 ? 3
                             : lead < 0xF5 ? 4
                                           : 0;
  if (length == 0 || length > text.size()) return 0;
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xC0) != 0x80) return 0;
  }
  const bool overlong = (lead == 0xE0 && byte(1) < 0xA0) || (lead == 0xF0 && byte(1) < 0x90);
  const bool outside = (lead == 0xED && byte(1) >= 0xA0) || (lead == 0xF4 && byte(1) >= 0x90);
  return overlong || outside ? 0 : length;
}

}  // namespace

std::string json_quote(std::string_view text) {
  std::string quoted = "\"";
  while (!text.empty()) {
    const std::size_t length = utf8_length(text);
    if (length == 0) {
      quoted += "\xEF\xBF\xBD";
      text.remove_prefix(1);
      continue;
    }
    const char c = text.front();
    if (c == '"' || c == '\\') {
      quoted += '\\';
      quoted += c;
    } else if (static_cast<unsigned char>(c) < 0x20) {
      std::array<char, 8> escape{};
      std::snprintf(escape.data(), escape.size(), "\\u%04x", c);
      quoted += escape.data();
    } else {
      quoted += text.substr(0, length);
    }
    text.remove_prefix(length);
  }
  return quoted += '"';
}

JsonLine::JsonLine(std::string_view type) {
  text_.reserve(200);
  add("type", type);
}

JsonLine& JsonLine::raw(std::string_view key, std::string_view value) {
  if (!text_.empty()) text_ += ',';
  text_ += '"';
  text_ += key;
  text_ += "\":";
  text_ += value;
  return *this;
}

JsonLine& JsonLine::add(std::string_view key, std::string_view value) {
  return raw(key, json_quote(value));
}

JsonLine& JsonLine::add(std::string_view key, double value) {
  if (!std::isfinite(value)) return raw(key, "null");
  std::array<char, 32> digits{};
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), value).ptr;
  return raw(key, std::string_view(digits.data(), static_cast<std::size_t>(end - digits.data())));
}

JsonLine& JsonLine::add_ms(std::string_view key, Duration value) {
  std::array<char, 32> digits{};
  const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), to_ms(value),
                                 std::chars_format::fixed, 3)
                       .ptr;
  return raw(key, std::string_view(digits.data(), static_cast<std::size_t>(end - digits.data())));
}

}  // namespace slambed
