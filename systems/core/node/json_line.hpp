// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <concepts>
#include <cstdint>
#include <string>
#include <string_view>

#include "base/time.hpp"

namespace slambed {

/// Text as a JSON string with its quotes; bytes that are not UTF-8 become U+FFFD.
std::string json_quote(std::string_view text);

/// One flat JSON object, built field by field without a tree because events are written at frame
/// rate.
class JsonLine {
 public:
  explicit JsonLine(std::string_view type);

  JsonLine& add(std::string_view key, std::string_view value);
  JsonLine& add(std::string_view key, const char* value) {
    return add(key, std::string_view(value));
  }
  JsonLine& add(std::string_view key, bool value) { return raw(key, value ? "true" : "false"); }
  /// A value that is not finite becomes null, as JSON cannot express it.
  JsonLine& add(std::string_view key, double value);
  template <std::integral T>
  JsonLine& add(std::string_view key, T value) {
    return raw(key, std::to_string(value));
  }
  /// Milliseconds with three decimals.
  JsonLine& add_ms(std::string_view key, Duration value);
  JsonLine& add_ns(std::string_view key, Duration value) { return add(key, value.count()); }

  /// The fields, from `"type":...` on, without the braces.
  const std::string& fields() const { return text_; }

 private:
  JsonLine& raw(std::string_view key, std::string_view value);
  std::string text_;
};

}  // namespace slambed
