// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace slambed {

/// Type and range of a parameter. Defaults, sources and explanations live in system.yaml; run.json
/// carries every value, so that no node has a hidden default.
struct ParameterSpec {
  enum class Type { kInt, kFloat, kBool, kText, kPath };
  std::string name;
  Type type = Type::kInt;
  double min = 0, max = 0;           ///< of numbers, inclusive
  std::vector<std::string> choices;  ///< of texts

  static ParameterSpec integer(std::string name, double min, double max);
  static ParameterSpec real(std::string name, double min, double max);
  static ParameterSpec boolean(std::string name);
  static ParameterSpec choice(std::string name, std::vector<std::string> choices);
  static ParameterSpec path(std::string name);  ///< of an input file; empty: none
};

/// The checked values of one run.
class Parameters {
 public:
  /// Throws bad_input, naming the parameter, if one is missing, unknown, of another type or out of
  /// range.
  Parameters(const nlohmann::json& values, const std::vector<ParameterSpec>& specs,
             const std::string& where);

  /// Whether the system has such a parameter.
  bool has(const std::string& name) const { return values_.contains(name); }
  int integer(const std::string& name) const;
  double real(const std::string& name) const;
  bool boolean(const std::string& name) const;
  std::string text(const std::string& name) const;

 private:
  nlohmann::json values_;
};

/// The list as JSON, for `slambed-node --describe` and the test that compares it with system.yaml.
nlohmann::json describe(const std::vector<ParameterSpec>& specs);

}  // namespace slambed
