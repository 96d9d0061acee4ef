// SPDX-License-Identifier: Apache-2.0
#include "run/run_config.hpp"

#include "base/json_reader.hpp"
#include "run/device_config.hpp"

namespace slambed {
namespace {

PlaybackConfig read_playback(const nlohmann::json& json, const std::string& where) {
  JsonReader in(json, where);
  PlaybackConfig playback;
  const std::string mode = in.text("mode");
  if (mode == "every_frame") {
    playback.mode = PlaybackMode::kEveryFrame;
  } else if (mode != "realtime") {
    in.fail("mode", "is '" + mode + "'; it must be realtime or every_frame");
  }
  playback.fps = in.number_or_null("fps");
  if (playback.fps && *playback.fps <= 0) in.fail("fps", "must be above 0");
  playback.start_s = in.number("start_s");
  if (playback.start_s < 0) in.fail("start_s", "must not be negative");
  playback.end_s = in.number_or_null("end_s");
  if (playback.end_s && *playback.end_s <= playback.start_s)
    in.fail("end_s", "must be after start_s");
  if (in.has("stop_at_first_loss")) {
    const auto& stop = in.any("stop_at_first_loss");
    if (!stop.is_boolean()) in.fail("stop_at_first_loss", "must be true or false");
    playback.stop_at_first_loss = stop.get<bool>();
  }
  in.done();
  return playback;
}

constexpr double kLongestStep_s = 3600, kLargestRtt_ms = 1e6, kLongestAnswer_s = 60;

RttTable read_rtt(const nlohmann::json& json, const std::string& where) {
  JsonReader in(json, where);
  RttTable table;
  const double step_s = in.number("step_s");
  if (!(step_s >= 1e-3 && step_s <= kLongestStep_s)) in.fail("step_s", "must be 0.001 to 3600");
  table.step = from_seconds(step_s);
  const auto& values = in.any("rtt_ms");
  if (!values.is_array() || values.empty()) in.fail("rtt_ms", "must be a list of numbers");
  for (const auto& value : values) {
    if (!value.is_number() || value < 0 || value > kLargestRtt_ms) {
      in.fail("rtt_ms", "must be numbers from 0 to 1,000,000");
    }
    table.values.push_back(from_seconds(value.get<double>() / 1000));
  }
  in.done();
  return table;
}

NetworkConfig read_network(const nlohmann::json& json, const std::string& where) {
  JsonReader in(json, where);
  NetworkConfig network;
  network.edge_address = in.text("edge_address");
  const auto& ports = in.any("ports");
  JsonReader names(ports, in.where() + "ports.");
  for (const auto& [channel, port] : ports.items()) {
    network.ports[channel] = static_cast<std::uint16_t>(names.integer(channel, 1, UINT16_MAX));
  }
  if (in.has("profile_rtt")) {
    network.profile_rtt = read_rtt(in.any("profile_rtt"), in.where() + "profile_rtt.");
  }
  in.done();
  return network;
}

SegmenterConfig read_segmenter(const nlohmann::json& json, const std::string& where) {
  JsonReader in(json, where);
  SegmenterConfig segmenter{.socket = in.text("socket"), .time_limit_s = in.number("time_limit_s")};
  if (!segmenter.socket.is_absolute()) in.fail("socket", "must be an absolute path");
  if (!(segmenter.time_limit_s > 0 && segmenter.time_limit_s <= kLongestAnswer_s))
    in.fail("time_limit_s", "must be above 0, at most 60");
  in.done();
  return segmenter;
}

PaceConfig read_pace(const nlohmann::json& json, const std::string& where) {
  JsonReader in(json, where);
  PaceConfig pace{.share = in.number("share"),
                  .device = read_device(in.any("device"), where + "device.")};
  if (!(pace.share > 0 && pace.share <= 1)) in.fail("share", "must be above 0, at most 1");
  in.done();
  return pace;
}

}  // namespace

RunConfig read_run_config(const std::filesystem::path& path) {
  const nlohmann::json json = read_json(path);
  const std::string where = path.string() + ": ";
  JsonReader in(json, where);
  RunConfig config;
  if (in.text("format") != "slambed-run") in.fail("format", "must be 'slambed-run'");
  in.integer("version", 1, 1);
  config.run_key = in.text("run_key");
  config.seed = static_cast<std::uint64_t>(in.integer("seed", 0, INT64_MAX));
  config.system = in.text("system");
  config.variant = in.text("variant");
  config.params = in.any("params");
  if (!config.params.is_object()) in.fail("params", "must be an object");
  config.sequence = in.text("sequence");
  config.playback = read_playback(in.any("playback"), where + "playback.");
  if (const auto* network = in.object_or_null("network")) {
    config.network = read_network(*network, where + "network.");
  }
  if (in.has("segmenter")) {
    config.segmenter = read_segmenter(in.any("segmenter"), where + "segmenter.");
  }
  if (in.has("pace")) {
    const std::string at = where + "pace.";
    JsonReader pace(in.any("pace"), at);
    config.pace[NodeRole::kMobile] = read_pace(pace.any("mobile"), at + "mobile.");
    if (pace.has("edge")) {
      if (const auto* edge = pace.object_or_null("edge"))
        config.pace[NodeRole::kEdge] = read_pace(*edge, at + "edge.");
    }
    pace.done();
    if (config.network.has_value() != config.pace.contains(NodeRole::kEdge))
      in.fail("pace", "edge must be given exactly where there is a network");
  }
  config.output = in.text("output");
  config.connect_timeout_s = in.number("connect_timeout_s");
  if (config.connect_timeout_s < 0) in.fail("connect_timeout_s", "must not be negative");
  in.done();
  return config;
}

}  // namespace slambed
