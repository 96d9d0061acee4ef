// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <initializer_list>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

#include "link/direction.hpp"

namespace slambed::link {

/// A JSON object and its path in the file, for error messages. The JSON must outlive it.
class Section {
 public:
  Section(const nlohmann::json& json, std::string where);

  [[noreturn]] void fail(const std::string& what) const;
  void only(std::initializer_list<std::string_view> known) const;
  bool has(const char* key) const;
  Section section(const char* key) const;
  const nlohmann::json& array(const char* key) const;
  double number(const char* key, double fallback, double least, double most) const;
  std::string text(const char* key, const std::string& fallback = {}) const;

 private:
  const nlohmann::json& json_;
  std::string where_;
};

/// Reads one direction of a link as slambed.link compiles it from a profile: delay_us, jitter,
/// loss, rate, gaps_s and gap_drops from its section, step_ms and interpolation from the root.
DirectionOptions read_direction(const Section& section, const Section& root, int mtu);

}  // namespace slambed::link
