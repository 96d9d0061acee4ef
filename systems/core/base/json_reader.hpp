// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>

namespace slambed {

/// Reads a JSON file. Throws bad_input, with file name and byte offset, when it is not valid JSON.
nlohmann::json read_json(const std::filesystem::path& path);

/// Reads one JSON object strictly. Throws bad_input with the full key name for a wrong type, a
/// missing key and, in done(), a key that was never read.
class JsonReader {
 public:
  /// where: prefix of every key in messages, such as "run.json: " or "run.json: playback.".
  JsonReader(const nlohmann::json& object, std::string where);

  std::string text(const std::string& key);
  double number(const std::string& key);
  std::int64_t integer(const std::string& key, std::int64_t min, std::int64_t max);
  std::optional<double> number_or_null(const std::string& key);
  const nlohmann::json& any(const std::string& key);
  bool has(const std::string& key) const { return object_.contains(key); }
  /// Returns a nested object, or a null pointer when the value is null.
  const nlohmann::json* object_or_null(const std::string& key);
  void done() const;
  const std::string& where() const { return where_; }

  [[noreturn]] void fail(const std::string& key, const std::string& what) const;

 private:
  const nlohmann::json& object_;
  std::string where_;
  std::set<std::string> asked_;
};

}  // namespace slambed
