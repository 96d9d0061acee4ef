// SPDX-License-Identifier: Apache-2.0
#include "run/sim_config.hpp"

#include "base/error.hpp"
#include "base/json_reader.hpp"
#include "link/direction_config.hpp"
#include "run/device_config.hpp"

namespace slambed {
namespace {

constexpr int kMtu = 1500;  ///< as in live runs; a queue must hold at least one packet
constexpr double kLongest_s = 1e6;

SimConfig::Cache read_cache(const nlohmann::json& json, const std::string& where) {
  JsonReader file(json, where);
  SimConfig::Cache cache{file.text("path"), file.text("key")};
  file.done();
  return cache;
}

void read_masks(const nlohmann::json& json, const std::string& where, SimConfig& config) {
  if (!json.is_array()) throw bad_input(where + " must be a list");
  for (const auto& entry : json) {
    JsonReader in(entry, where + ".");
    const double threshold = in.number("n_m");
    config.masks[threshold] = {in.text("path"), in.text("key")};
    in.done();
  }
}

}  // namespace

LinkModel read_link(const nlohmann::json& json, const std::string& where) {
  const link::Section root(json, where);
  root.only({"step_ms", "interpolation", "up", "down"});
  return {.up = link::read_direction(root.section("up"), root, kMtu),
          .down = link::read_direction(root.section("down"), root, kMtu)};
}

SimConfig read_sim_config(const std::filesystem::path& path) {
  const nlohmann::json json = read_json(path);
  const std::string where = path.string() + ": ";
  JsonReader in(json, where);
  if (in.text("format") != "slambed-sim") in.fail("format", "must be \"slambed-sim\"");
  in.integer("version", 1, 1);
  SimConfig config;
  config.run = read_run_config(path.parent_path() / in.text("run"));

  const nlohmann::json* devices = in.object_or_null("devices");
  if (!devices) in.fail("devices", "must be an object");
  JsonReader device(*devices, where + "devices.");
  config.mobile = read_device(device.any("mobile"), where + "devices.mobile.");
  if (const auto* edge = device.object_or_null("edge")) {
    config.edge = read_device(*edge, where + "devices.edge.");
  }
  device.done();

  if (const auto* json_link = in.object_or_null("link")) {
    config.link = read_link(*json_link, where + "link");
  }
  const nlohmann::json& frozen = in.any("edge_frozen_s");
  if (!frozen.is_array()) in.fail("edge_frozen_s", "must be a list of [begin, end]");
  for (const auto& span : frozen) {
    const bool pair = span.is_array() && span.size() == 2 && span[0].is_number() &&
                      span[1].is_number() && 0 <= span[0] && span[0] < span[1] &&
                      span[1] <= kLongest_s;
    if (!pair || !config.edge) {
      in.fail("edge_frozen_s", "must be a list of [begin, end] in s, and empty without an edge");
    }
    config.edge_frozen.push_back({from_seconds(span[0]), from_seconds(span[1])});
  }
  if (in.has("limit_s")) {
    const double limit_s = in.number("limit_s");
    if (!(limit_s > 0 && limit_s <= kLongest_s)) in.fail("limit_s", "must be above 0, at most 1e6");
    config.limit = from_seconds(limit_s);
  }
  if (const auto* cache = in.object_or_null("feature_cache"))
    config.features = read_cache(*cache, where + "feature_cache.");
  if (in.has("image_cache"))
    config.images = read_cache(in.any("image_cache"), where + "image_cache.");
  if (in.has("mask_caches")) read_masks(in.any("mask_caches"), where + "mask_caches", config);
  in.done();
  if (config.run.network.has_value() != config.edge.has_value()) {
    in.fail("devices", "edge must be given exactly where run.json has a network");
  }
  return config;
}

}  // namespace slambed
