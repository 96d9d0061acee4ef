// SPDX-License-Identifier: Apache-2.0
#include "link/direction_config.hpp"

#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/error.hpp"

namespace slambed::link {
namespace {

using Json = nlohmann::json;

constexpr double kNsPerMs = 1e6;
constexpr double kNsPerUs = 1e3;
constexpr double kShortestState_s = 1e-4, kLongestState_s = 1e6;
constexpr double kLongestDelayUs = 60e6;  // one minute; more is probably a unit error

JitterOptions read_jitter(const Section& section) {
  section.only(
      {"shape", "scale_us", "pareto_shape", "max_us", "correlation", "correlation_time_s"});
  JitterOptions jitter;
  const std::string shape = section.text("shape", "normal");
  if (shape != "normal" && shape != "pareto") section.fail("'shape' is not normal or pareto");
  jitter.shape = shape == "pareto" ? JitterShape::kPareto : JitterShape::kNormal;
  jitter.scale_ns = section.number("scale_us", 0, 0, kLongestDelayUs) * kNsPerUs;
  jitter.pareto_shape = section.number("pareto_shape", 3, 1.01, 100);
  jitter.max_ns = section.number("max_us", 0, 0, kLongestDelayUs) * kNsPerUs;
  jitter.correlation = section.number("correlation", 0, 0, 1);
  jitter.correlation_time_ns = section.number("correlation_time_s", 0, 0, 3600) * kNsPerS;
  return jitter;
}

LossOptions read_loss(const Section& section) {
  section.only({"to_bad", "to_good", "loss_good", "loss_bad", "good_s", "bad_s"});
  LossOptions loss{section.number("to_bad", 0, 0, 1), section.number("to_good", 1, 0, 1),
                   section.number("loss_good", 0, 0, 1), section.number("loss_bad", 1, 0, 1)};
  if (section.has("good_s") != section.has("bad_s"))
    section.fail("needs both 'good_s' and 'bad_s'");
  if (!section.has("bad_s")) return loss;
  if (section.has("to_bad") || section.has("to_good")) {
    section.fail("has a chain per packet ('to_bad') and one in time ('bad_s')");
  }
  loss.mean_good_ns = section.number("good_s", 0, kShortestState_s, kLongestState_s) * kNsPerS;
  loss.mean_bad_ns = section.number("bad_s", 0, kShortestState_s, kLongestState_s) * kNsPerS;
  return loss;
}

RateOptions read_rate(const Section& section, int mtu) {
  section.only({"bits_per_s", "opportunities_ms", "queue_bytes"});
  RateOptions rate;
  rate.bits_per_s = section.number("bits_per_s", 0, 1e3, 1e12);
  rate.queue_bytes = static_cast<std::int64_t>(section.number("queue_bytes", 0, mtu, 1e10));
  if (rate.queue_bytes == 0) section.fail("lacks 'queue_bytes'");
  if (section.has("opportunities_ms")) {
    std::int64_t last = 0;
    for (const Json& value : section.array("opportunities_ms")) {
      if (!value.is_number_integer())
        section.fail("'opportunities_ms' has a value that is no integer");
      const auto time_ms = value.get<std::int64_t>();
      if (time_ms < last) section.fail("'opportunities_ms' goes back in time");
      last = time_ms;
      rate.opportunities_ns.push_back(time_ms * static_cast<std::int64_t>(kNsPerMs));
    }
    // As in Mahimahi, the trace repeats after its last timestamp.
    rate.period_ns = last * static_cast<std::int64_t>(kNsPerMs);
    if (rate.period_ns == 0) section.fail("'opportunities_ms' ends at 0");
  }
  if ((rate.bits_per_s > 0) == !rate.opportunities_ns.empty()) {
    section.fail("needs either 'bits_per_s' or 'opportunities_ms'");
  }
  return rate;
}

void read_gaps(const Section& section, DirectionOptions& direction) {
  for (const Json& value : section.array("gaps_s")) {
    if (!value.is_array() || value.size() != 2 || !value[0].is_number() || !value[1].is_number()) {
      section.fail("'gaps_s' needs pairs [start, end]");
    }
    const Gap gap{static_cast<std::int64_t>(value[0].get<double>() * kNsPerS),
                  static_cast<std::int64_t>(value[1].get<double>() * kNsPerS)};
    if (gap.start_ns < 0 || gap.end_ns <= gap.start_ns) section.fail("'gaps_s' has an empty gap");
    direction.gaps.push_back(gap);
  }
}

}  // namespace

Section::Section(const Json& json, std::string where) : json_(json), where_(std::move(where)) {
  if (!json_.is_object()) fail("is not an object");
}

void Section::fail(const std::string& what) const {
  throw bad_input("link configuration " + what + ", " + where_ + ", correct the configuration");
}

void Section::only(std::initializer_list<std::string_view> known) const {
  for (const auto& [key, value] : json_.items()) {
    bool found = false;
    for (const auto name : known) found = found || name == key;
    if (!found) fail("has the unknown key '" + key + "'");
  }
}

bool Section::has(const char* key) const { return json_.contains(key) && !json_.at(key).is_null(); }

Section Section::section(const char* key) const {
  if (!has(key)) fail(std::string("lacks '") + key + "'");
  return {json_.at(key), where_ + "." + key};
}

const Json& Section::array(const char* key) const {
  if (!has(key) || !json_.at(key).is_array()) fail(std::string("needs a list '") + key + "'");
  return json_.at(key);
}

double Section::number(const char* key, double fallback, double least, double most) const {
  if (!has(key)) return fallback;
  if (!json_.at(key).is_number()) fail(std::string("'") + key + "' is not a number");
  const double value = json_.at(key).get<double>();
  if (!(value >= least && value <= most)) {  // also refuses NaN
    fail(std::string("'") + key + "' is out of range");
  }
  return value;
}

std::string Section::text(const char* key, const std::string& fallback) const {
  if (!has(key)) return fallback;
  if (!json_.at(key).is_string()) fail(std::string("'") + key + "' is not text");
  return json_.at(key).get<std::string>();
}

DirectionOptions read_direction(const Section& section, const Section& root, int mtu) {
  section.only({"delay_us", "jitter", "loss", "rate", "gaps_s", "gap_drops"});
  DirectionOptions direction;
  direction.step_ns = static_cast<std::int64_t>(root.number("step_ms", 10, 0.1, 10000) * kNsPerMs);
  const std::string interpolation = root.text("interpolation", "linear");
  if (interpolation != "linear" && interpolation != "step") {
    root.fail("'interpolation' is not linear or step");
  }
  direction.interpolation = interpolation == "step" ? Interpolation::kStep : Interpolation::kLinear;
  direction.delays_ns.clear();
  for (const Json& value : section.array("delay_us")) {
    if (!value.is_number()) section.fail("'delay_us' has a value that is no number");
    const double delay_us = value.get<double>();
    if (!(delay_us >= 0)) section.fail("'delay_us' has a negative delay");
    if (delay_us > kLongestDelayUs) section.fail("'delay_us' has a delay above one minute");
    direction.delays_ns.push_back(std::llround(delay_us * kNsPerUs));
  }
  if (direction.delays_ns.empty()) section.fail("'delay_us' is empty");
  if (section.has("jitter")) direction.jitter = read_jitter(section.section("jitter"));
  if (section.has("loss")) direction.loss = read_loss(section.section("loss"));
  if (section.has("rate")) direction.rate = read_rate(section.section("rate"), mtu);
  if (section.has("gaps_s")) read_gaps(section, direction);
  direction.gap_drops = section.number("gap_drops", 0, 0, 1) > 0;
  return direction;
}

}  // namespace slambed::link
