// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <initializer_list>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

#include "link/direction.hpp"

namespace slambed::link {

/// One JSON object together with its place in the file, for errors that say where. The JSON must
/// outlive it.
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

/// One direction of a link: keys delay_us, jitter, loss, rate, gaps_s, gap_drops of its section;
/// step_ms and interpolation of the root. What slambed.link compiles a profile to.
DirectionOptions read_direction(const Section& section, const Section& root, int mtu);

}  // namespace slambed::link
