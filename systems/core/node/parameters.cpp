// SPDX-License-Identifier: Apache-2.0
#include "node/parameters.hpp"

#include <algorithm>

#include "base/json_reader.hpp"

namespace slambed {
namespace {

const char* type_name(ParameterSpec::Type type) {
  switch (type) {
    case ParameterSpec::Type::kInt:
      return "int";
    case ParameterSpec::Type::kFloat:
      return "float";
    case ParameterSpec::Type::kBool:
      return "bool";
    case ParameterSpec::Type::kText:
      return "str";
    case ParameterSpec::Type::kPath:
      return "path";
  }
  return "";
}

std::string number_text(double value) { return nlohmann::json(value).dump(); }

void check(JsonReader& in, const ParameterSpec& spec) {
  const auto& value = in.any(spec.name);
  const auto must = [&](bool good, const std::string& what) {
    if (!good) in.fail(spec.name, "is " + value.dump() + "; it must be " + what);
  };
  switch (spec.type) {
    case ParameterSpec::Type::kInt:
      must(value.is_number_integer() && value.get<double>() >= spec.min &&
               value.get<double>() <= spec.max,
           "a whole number from " + std::to_string(static_cast<long long>(spec.min)) + " to " +
               std::to_string(static_cast<long long>(spec.max)));
      break;
    case ParameterSpec::Type::kFloat:
      must(value.is_number() && value.get<double>() >= spec.min && value.get<double>() <= spec.max,
           "a number from " + number_text(spec.min) + " to " + number_text(spec.max));
      break;
    case ParameterSpec::Type::kBool:
      must(value.is_boolean(), "true or false");
      break;
    case ParameterSpec::Type::kText: {
      std::string all;
      for (const auto& choice : spec.choices) all += (all.empty() ? "" : ", ") + choice;
      must(value.is_string() &&
               std::count(spec.choices.begin(), spec.choices.end(), value.get<std::string>()) > 0,
           "one of: " + all);
      break;
    }
    case ParameterSpec::Type::kPath:
      must(value.is_string(), "a path, or empty");
      break;
  }
}

}  // namespace

ParameterSpec ParameterSpec::integer(std::string name, double min, double max) {
  return {.name = std::move(name), .type = Type::kInt, .min = min, .max = max, .choices = {}};
}
ParameterSpec ParameterSpec::real(std::string name, double min, double max) {
  return {.name = std::move(name), .type = Type::kFloat, .min = min, .max = max, .choices = {}};
}
ParameterSpec ParameterSpec::boolean(std::string name) {
  return {.name = std::move(name), .type = Type::kBool, .min = 0, .max = 0, .choices = {}};
}
ParameterSpec ParameterSpec::choice(std::string name, std::vector<std::string> choices) {
  return {.name = std::move(name),
          .type = Type::kText,
          .min = 0,
          .max = 0,
          .choices = std::move(choices)};
}
ParameterSpec ParameterSpec::path(std::string name) {
  return {.name = std::move(name), .type = Type::kPath, .min = 0, .max = 0, .choices = {}};
}

Parameters::Parameters(const nlohmann::json& values, const std::vector<ParameterSpec>& specs,
                       const std::string& where)
    : values_(values) {
  JsonReader in(values_, where);
  for (const ParameterSpec& spec : specs) check(in, spec);
  in.done();
}

int Parameters::integer(const std::string& name) const { return values_.at(name).get<int>(); }
double Parameters::real(const std::string& name) const { return values_.at(name).get<double>(); }
bool Parameters::boolean(const std::string& name) const { return values_.at(name).get<bool>(); }
std::string Parameters::text(const std::string& name) const {
  return values_.at(name).get<std::string>();
}

nlohmann::json describe(const std::vector<ParameterSpec>& specs) {
  auto list = nlohmann::json::object();
  for (const ParameterSpec& spec : specs) {
    nlohmann::json entry{{"type", type_name(spec.type)}};
    if (spec.type == ParameterSpec::Type::kInt) {
      entry["min"] = static_cast<std::int64_t>(spec.min);
      entry["max"] = static_cast<std::int64_t>(spec.max);
    }
    if (spec.type == ParameterSpec::Type::kFloat) {
      entry["min"] = spec.min;
      entry["max"] = spec.max;
    }
    if (!spec.choices.empty()) entry["choices"] = spec.choices;
    list[spec.name] = std::move(entry);
  }
  return list;
}

}  // namespace slambed
