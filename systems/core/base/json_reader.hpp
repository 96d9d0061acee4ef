// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>

namespace slambed {

/// Reads a JSON file; bad_input naming file and place when it is none.
nlohmann::json read_json(const std::filesystem::path& path);

/// Strict access to one JSON object: a key of the wrong type, a missing one and, at done(), one
/// that nobody asked for are bad_input with the key's full name.
class JsonReader {
 public:
  /// where: "run.json: " or "run.json: playback."; put before every key in messages.
  JsonReader(const nlohmann::json& object, std::string where);

  std::string text(const std::string& key);
  double number(const std::string& key);
  std::int64_t integer(const std::string& key, std::int64_t min, std::int64_t max);
  std::optional<double> number_or_null(const std::string& key);
  const nlohmann::json& any(const std::string& key);
  bool has(const std::string& key) const { return object_.contains(key); }
  /// Reads a nested object; null when the value is null.
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
