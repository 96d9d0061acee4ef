// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "base/error.hpp"
#include "base/tests/temporary_folder.hpp"
#include "node/parameters.hpp"
#include "run/run_config.hpp"

namespace slambed {
namespace {

nlohmann::json valid() {
  return nlohmann::json::parse(R"({
    "format": "slambed-run", "version": 1, "run_key": "abc", "seed": 7,
    "system": "edgeslam", "variant": "static", "params": {"n_orb": 750},
    "sequence": "/sequence",
    "playback": {"mode": "realtime", "fps": 10.0, "start_s": 0.0, "end_s": null},
    "network": {"edge_address": "10.77.0.2", "ports": {"control": 47000, "map": 47002}},
    "output": "/out", "connect_timeout_s": 20.0 })");
}

/// Returns the one-line error message about a configuration, or an empty string.
std::string complaint(const nlohmann::json& json) {
  testing::TemporaryFolder folder;
  const auto path = folder.write("run.json", json.dump());
  try {
    read_run_config(path);
    return "";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kBadInput);
    EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
    return error.what();
  }
}

TEST(RunConfig, IsReadAsWritten) {
  testing::TemporaryFolder folder;
  const RunConfig config = read_run_config(folder.write("run.json", valid().dump()));
  EXPECT_EQ(config.run_key, "abc");
  EXPECT_EQ(config.seed, 7u);
  EXPECT_EQ(config.playback.mode, PlaybackMode::kRealtime);
  EXPECT_EQ(config.playback.fps, 10.0);
  EXPECT_FALSE(config.playback.end_s);
  EXPECT_FALSE(config.playback.stop_at_first_loss);
  ASSERT_TRUE(config.network);
  EXPECT_EQ(config.network->ports.at("map"), 47002);
  auto alone = valid();
  alone["network"] = nullptr;
  alone["playback"]["stop_at_first_loss"] = true;
  const RunConfig changed = read_run_config(folder.write("alone.json", alone.dump()));
  EXPECT_FALSE(changed.network);
  EXPECT_TRUE(changed.playback.stop_at_first_loss);
}

TEST(RunConfig, EveryKeyIsNeeded) {
  const auto whole = valid();
  for (const auto& [key, value] : whole.items()) {
    auto json = valid();
    json.erase(key);
    EXPECT_NE(complaint(json).find(key), std::string::npos) << key;
  }
}

TEST(RunConfig, UnknownKeysAreNamed) {
  auto json = valid();
  json["sytem"] = "x";
  EXPECT_NE(complaint(json).find("sytem is unknown"), std::string::npos);
  json = valid();
  json["playback"]["speed"] = 2;
  EXPECT_NE(complaint(json).find("playback.speed is unknown"), std::string::npos);
  json = valid();
  json["network"]["host"] = "x";
  EXPECT_NE(complaint(json).find("network.host is unknown"), std::string::npos);
}

TEST(RunConfig, WrongValuesAreNamed) {
  const auto with = [](const char* pointer, nlohmann::json value) {
    auto json = valid();
    json[nlohmann::json::json_pointer(pointer)] = std::move(value);
    return complaint(json);
  };
  EXPECT_NE(with("/format", "other").find("format"), std::string::npos);
  EXPECT_NE(with("/version", 2).find("version"), std::string::npos);
  EXPECT_NE(with("/seed", -1).find("seed"), std::string::npos);
  EXPECT_NE(with("/seed", 1.5).find("seed"), std::string::npos);
  EXPECT_NE(with("/playback/mode", "fast").find("playback.mode is 'fast'"), std::string::npos);
  EXPECT_NE(with("/playback/fps", 0).find("playback.fps"), std::string::npos);
  EXPECT_NE(with("/playback/fps", "10").find("playback.fps"), std::string::npos);
  EXPECT_NE(with("/playback/start_s", -1).find("playback.start_s"), std::string::npos);
  EXPECT_NE(with("/playback/end_s", 0).find("playback.end_s"), std::string::npos);
  EXPECT_NE(with("/network/ports/map", 70000).find("network.ports.map"), std::string::npos);
  EXPECT_NE(with("/network/ports/map", 0).find("network.ports.map"), std::string::npos);
  EXPECT_NE(with("/network/ports", 3).find("ports"), std::string::npos);
  EXPECT_NE(with("/params", 3).find("params"), std::string::npos);
  EXPECT_NE(with("/connect_timeout_s", -1).find("connect_timeout_s"), std::string::npos);
  EXPECT_EQ(with("/playback/fps", nullptr), "");
}

TEST(RunConfig, ASegmenterIsOptionalAndChecked) {
  testing::TemporaryFolder folder;
  auto json = valid();
  EXPECT_FALSE(read_run_config(folder.write("run.json", json.dump())).segmenter);
  json["segmenter"] = {{"socket", "/out/segmenter/socket"}, {"time_limit_s", 1.5}};
  const auto segmenter = read_run_config(folder.write("run.json", json.dump())).segmenter;
  ASSERT_TRUE(segmenter);
  EXPECT_EQ(segmenter->socket, "/out/segmenter/socket");
  EXPECT_EQ(segmenter->time_limit_s, 1.5);
  const auto with = [&](const char* key, nlohmann::json value) {
    auto changed = json;
    changed["segmenter"][key] = std::move(value);
    return complaint(changed);
  };
  EXPECT_NE(with("socket", "here").find("segmenter.socket"), std::string::npos);
  EXPECT_NE(with("time_limit_s", 0).find("segmenter.time_limit_s"), std::string::npos);
  EXPECT_NE(with("time_limit_s", 61).find("segmenter.time_limit_s"), std::string::npos);
  EXPECT_NE(with("network", "x").find("segmenter.network is unknown"), std::string::npos);
}

TEST(RunConfig, APaceIsTheDeviceOfEachNode) {
  testing::TemporaryFolder folder;
  auto json = valid();
  EXPECT_TRUE(read_run_config(folder.write("run.json", json.dump())).pace.empty());
  const nlohmann::json device = nlohmann::json::parse(R"({
    "cores": 4, "speed": 1.0, "background": 0.7,
    "stages": {"track": {"a_us": 5, "b_us": 1, "c_us": 0, "jitter": 0.1}}})");
  json["pace"] = {{"mobile", {{"share", 0.25}, {"device", device}}},
                  {"edge", {{"share", 1.0}, {"device", device}}}};
  const auto pace = read_run_config(folder.write("run.json", json.dump())).pace;
  EXPECT_EQ(pace.at(NodeRole::kMobile).share, 0.25);
  EXPECT_EQ(pace.at(NodeRole::kMobile).device.background, 0.7);
  EXPECT_EQ(pace.at(NodeRole::kEdge).device.stages.at("track").a_us, 5);
  const auto with = [&](const char* pointer, nlohmann::json value) {
    auto changed = json;
    changed[nlohmann::json::json_pointer(pointer)] = std::move(value);
    return complaint(changed);
  };
  EXPECT_NE(with("/pace/mobile/share", 0).find("pace.mobile.share"), std::string::npos);
  EXPECT_NE(with("/pace/edge/share", 1.1).find("pace.edge.share"), std::string::npos);
  EXPECT_NE(with("/pace/edge/device/cores", 0).find("pace.edge.device.cores"), std::string::npos);
  EXPECT_NE(with("/pace/mobile/device/background", -1).find("background"), std::string::npos);
  EXPECT_NE(with("/pace/third", 1).find("pace.third is unknown"), std::string::npos);
  EXPECT_NE(with("/network", nullptr).find("pace"), std::string::npos);
  auto alone = json;
  alone["network"] = alone["pace"]["edge"] = nullptr;
  EXPECT_EQ(complaint(alone), "");
  json["pace"].erase("edge");
  EXPECT_NE(complaint(json).find("pace edge must be given"), std::string::npos);
}

TEST(RunConfig, TheProfilesRttIsATableOverRunTime) {
  testing::TemporaryFolder folder;
  const auto with = [&](const nlohmann::json& table) {
    auto json = valid();
    json["network"]["profile_rtt"] = table;
    return read_run_config(folder.write("run.json", json.dump())).network->profile_rtt;
  };
  const auto rtt = with({{"step_s", 0.1}, {"rtt_ms", {0, 20, 10}}});
  ASSERT_TRUE(rtt);
  EXPECT_EQ(rtt->at(from_seconds(-1)), Duration::zero());
  EXPECT_EQ(rtt->at(from_seconds(0.05)), from_seconds(0.010));
  EXPECT_EQ(rtt->at(from_seconds(0.1)), from_seconds(0.020));
  EXPECT_EQ(rtt->at(from_seconds(0.15)), from_seconds(0.015));
  EXPECT_EQ(rtt->at(from_seconds(0.2)), from_seconds(0.010));
  EXPECT_EQ(rtt->at(from_seconds(100)), from_seconds(0.010));
  EXPECT_EQ(with({{"step_s", 1}, {"rtt_ms", {7}}})->at(from_seconds(3)), from_seconds(0.007));
  // The largest numbers that are accepted.
  const auto large = with({{"step_s", 3600}, {"rtt_ms", {0, 1e6, 0}}});
  EXPECT_EQ(large->at(from_seconds(1800)), from_seconds(500));
  EXPECT_EQ(large->at(from_seconds(3600 + 2700)), from_seconds(250));
  const RttTable centuries{.step = from_seconds(3600),
                           .values = std::vector<Duration>(3'000'000, from_seconds(1))};
  EXPECT_EQ(centuries.at(from_seconds(7000)), from_seconds(1));
  EXPECT_THROW(with({{"step_s", 0}, {"rtt_ms", {7}}}), Error);
  EXPECT_THROW(with({{"step_s", 1}, {"rtt_ms", nlohmann::json::array()}}), Error);
  EXPECT_THROW(with({{"step_s", 1}, {"rtt_ms", {-1}}}), Error);
  EXPECT_THROW(with({{"step_s", 1}, {"rtt_ms", {"7"}}}), Error);
  EXPECT_THROW(with({{"step_s", 1}}), Error);
}

TEST(RunConfig, AFileThatIsNoJsonOrIsMissingIsBadInput) {
  testing::TemporaryFolder folder;
  EXPECT_THROW(read_run_config(folder.write("run.json", "{\"format\": ")), Error);
  EXPECT_THROW(read_run_config(folder.path() / "none.json"), Error);
  EXPECT_THROW(read_run_config(folder.write("list.json", "[]")), Error);
}

TEST(Parameters, AreCheckedByTheList) {
  const std::vector<ParameterSpec> specs = {
      ParameterSpec::integer("n", 1, 10), ParameterSpec::real("x", 0, 1),
      ParameterSpec::boolean("b"), ParameterSpec::choice("c", {"serial", "parallel"}),
      ParameterSpec::path("p")};
  const nlohmann::json good = {{"n", 3}, {"x", 1}, {"b", true}, {"c", "serial"}, {"p", "a/b.slm"}};
  const Parameters values(good, specs, "params.");
  EXPECT_EQ(values.integer("n"), 3);
  EXPECT_EQ(values.real("x"), 1.0);
  EXPECT_TRUE(values.boolean("b"));
  EXPECT_EQ(values.text("c"), "serial");
  EXPECT_EQ(values.text("p"), "a/b.slm");
  const auto refused = [&](const char* key, nlohmann::json value, const char* named) {
    auto json = good;
    json[key] = std::move(value);
    try {
      Parameters(json, specs, "params.");
      return false;
    } catch (const Error& error) {
      return std::string(error.what()).find(named) != std::string::npos;
    }
  };
  EXPECT_TRUE(refused("n", 0, "params.n is 0; it must be a whole number from 1 to 10"));
  EXPECT_TRUE(refused("n", 2.5, "params.n"));
  EXPECT_TRUE(refused("n", "3", "params.n"));
  EXPECT_TRUE(refused("x", 1.01, "params.x is 1.01; it must be a number from 0.0 to 1.0"));
  EXPECT_TRUE(refused("b", 1, "params.b"));
  EXPECT_TRUE(refused("c", "both", "one of: serial, parallel"));
  EXPECT_TRUE(refused("p", 1, "params.p is 1; it must be a path, or empty"));
  EXPECT_TRUE(refused("m", 1, "params.m is unknown"));
  auto missing = good;
  missing.erase("x");
  EXPECT_THROW(Parameters(missing, specs, "params."), Error);
}

}  // namespace
}  // namespace slambed
