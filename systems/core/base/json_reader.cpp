// SPDX-License-Identifier: Apache-2.0
#include "base/json_reader.hpp"

#include <cmath>
#include <fstream>

#include "base/error.hpp"

namespace slambed {

nlohmann::json read_json(const std::filesystem::path& path) {
  std::ifstream file(path);
  if (!file) throw bad_input(path.string() + ": cannot be read; check the path");
  try {
    return nlohmann::json::parse(file);
  } catch (const nlohmann::json::parse_error& error) {
    throw bad_input(path.string() + ": no JSON at byte " + std::to_string(error.byte) +
                    "; write the file again");
  }
}

JsonReader::JsonReader(const nlohmann::json& object, std::string where)
    : object_(object), where_(std::move(where)) {
  if (!object.is_object()) throw bad_input(where_ + " must be an object");
}

void JsonReader::fail(const std::string& key, const std::string& what) const {
  throw bad_input(where_ + key + " " + what);
}

const nlohmann::json& JsonReader::any(const std::string& key) {
  asked_.insert(key);
  const auto found = object_.find(key);
  if (found == object_.end()) fail(key, "is missing; add it");
  return *found;
}

std::string JsonReader::text(const std::string& key) {
  const auto& value = any(key);
  if (!value.is_string()) fail(key, "must be a string");
  return value.get<std::string>();
}

double JsonReader::number(const std::string& key) {
  const auto& value = any(key);
  if (!value.is_number() || !std::isfinite(value.get<double>())) fail(key, "must be a number");
  return value.get<double>();
}

std::int64_t JsonReader::integer(const std::string& key, std::int64_t min, std::int64_t max) {
  const auto& value = any(key);
  const bool fits = value.is_number_unsigned()
                        ? value.get<std::uint64_t>() <= static_cast<std::uint64_t>(INT64_MAX)
                        : value.is_number_integer();
  if (!fits || value.get<std::int64_t>() < min || value.get<std::int64_t>() > max) {
    fail(key, "must be a whole number from " + std::to_string(min) + " to " + std::to_string(max));
  }
  return value.get<std::int64_t>();
}

std::optional<double> JsonReader::number_or_null(const std::string& key) {
  if (any(key).is_null()) return std::nullopt;
  return number(key);
}

const nlohmann::json* JsonReader::object_or_null(const std::string& key) {
  const auto& value = any(key);
  if (value.is_null()) return nullptr;
  if (!value.is_object()) fail(key, "must be an object or null");
  return &value;
}

void JsonReader::done() const {
  for (const auto& [key, value] : object_.items()) {
    if (!asked_.contains(key)) fail(key, "is unknown; remove it or mend its name");
  }
}

}  // namespace slambed
