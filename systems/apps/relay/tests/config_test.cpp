// SPDX-License-Identifier: Apache-2.0
#include "apps/relay/config.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "base/error.hpp"

namespace slambed::relay {
namespace {

using Json = nlohmann::json;

Json good() {
  return Json::parse(R"({
    "format": "slambed-link", "version": 1, "seed": 3,
    "mobile": {"namespace": "/run/netns/a", "device": "slam0", "address": "10.77.0.1"},
    "edge": {"namespace": "/run/netns/b", "device": "slam0", "address": "10.77.0.2"},
    "up": {"delay_us": [0, 1500.5], "loss": {"loss_good": 0.1}},
    "down": {"delay_us": [20000], "rate": {"bits_per_s": 1e6, "queue_bytes": 30000}}
  })");
}

RelayOptions read(const std::string& text) {
  const auto path = std::filesystem::temp_directory_path() /
                    ("relay_config_" + std::to_string(getpid()) + ".json");
  std::ofstream(path) << text;
  struct Remove {
    std::filesystem::path file;
    ~Remove() { std::filesystem::remove(file); }
  } const remove{path};
  return read_config(path.string());
}

std::string complaint(const std::string& text) {
  try {
    read(text);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kBadInput);
    const std::string line = error.what();
    EXPECT_EQ(line.find('\n'), std::string::npos);
    return line;
  }
  ADD_FAILURE() << "accepted: " << text;
  return {};
}

TEST(RelayConfig, ReadsEveryPart) {
  const RelayOptions options = read(good().dump());
  EXPECT_EQ(options.up.delays_ns, (std::vector<std::int64_t>{0, 1'500'500}));
  EXPECT_EQ(options.down.delays_ns, (std::vector<std::int64_t>{20'000'000}));
  EXPECT_EQ(options.up.loss->loss_good, 0.1);
  EXPECT_EQ(options.down.rate->queue_bytes, 30000);
  EXPECT_EQ(options.seed, 3U);
  EXPECT_EQ(options.edge.address, "10.77.0.2");
}

TEST(RelayConfig, RefusesWhatItDoesNotUnderstandAndSaysWhere) {
  struct Case {
    const char* pointer;
    const char* value;
    const char* expected;
  };
  const Case cases[] = {
      {"/up/delay_us", "[1, -2]", "negative delay"},
      {"/up/delay_us", "[]", "'delay_us' is empty"},
      {"/up/delay_us", "[\"3 ms\"]", "no number"},
      {"/up/delay_us", "[70000000]", "above one minute"},
      {"/up/delays", "[1]", "unknown key 'delays'"},
      {"/up/loss/loss_good", "1.5", "'loss_good' is out of range"},
      {"/up/jitter", R"({"shape": "cauchy"})", "'shape' is not normal or pareto"},
      {"/down/rate/queue_bytes", "10", "'queue_bytes' is out of range"},
      {"/down/rate", R"({"queue_bytes": 3000})", "either 'bits_per_s' or 'opportunities_ms'"},
      {"/down/rate", R"({"queue_bytes": 3000, "opportunities_ms": [5, 3]})", "goes back in time"},
      {"/down/gaps_s", "[[3, 2]]", "empty gap"},
      {"/mobile/address", "\"10.77\"", "not an IPv4 address"},
      {"/mobile/device", "\"a-name-that-is-too-long\"", "1 to 15 characters"},
      {"/format", "\"other\"", "no format 'slambed-link'"},
      {"/version", "2", "version other than 1"},
      {"/mtu", "100", "'mtu' is out of range"},
  };
  for (const Case& each : cases) {
    Json json = good();
    json[Json::json_pointer(each.pointer)] = Json::parse(each.value);
    const std::string line = complaint(json.dump());
    EXPECT_NE(line.find(each.expected), std::string::npos) << each.pointer << ": " << line;
  }
}

TEST(RelayConfig, RefusesFilesThatAreNotJson) {
  EXPECT_NE(complaint("{\"format\":").find("not valid JSON"), std::string::npos);
  EXPECT_THROW(read_config("/nowhere/relay.json"), Error);
}

}  // namespace
}  // namespace slambed::relay
