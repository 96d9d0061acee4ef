// SPDX-License-Identifier: Apache-2.0
#include "run/device_config.hpp"

#include "base/json_reader.hpp"

namespace slambed {
namespace {

constexpr int kMaxCores = 1024;

StageCost read_stage(const nlohmann::json& json, const std::string& where) {
  JsonReader in(json, where);
  StageCost cost;
  cost.a_us = in.number("a_us");
  cost.b_us = in.number("b_us");
  cost.c_us = in.number("c_us");
  cost.jitter = in.number("jitter");
  if (in.has("accelerator")) cost.accelerator = in.text("accelerator");
  in.done();
  return cost;
}

}  // namespace

DeviceModel read_device(const nlohmann::json& json, const std::string& where) {
  JsonReader in(json, where);
  DeviceModel device;
  device.cores = static_cast<int>(in.integer("cores", 1, kMaxCores));
  device.speed = in.number("speed");
  if (in.has("background")) device.background = in.number("background");
  const nlohmann::json& stages = in.any("stages");
  if (!stages.is_object()) in.fail("stages", "must be an object: stage name to costs");
  for (const auto& [name, cost] : stages.items()) {
    device.stages[name] = read_stage(cost, where + "stages." + name + ".");
  }
  if (in.has("accelerators")) {
    const nlohmann::json& accelerators = in.any("accelerators");
    if (!accelerators.is_object()) in.fail("accelerators", "must be an object: name to lanes");
    for (const auto& [name, found] : accelerators.items()) {
      JsonReader one(found, where + "accelerators." + name + ".");
      device.accelerators[name] = {static_cast<int>(one.integer("lanes", 1, kMaxCores)),
                                   one.number("speed")};
      one.done();
    }
  }
  in.done();
  device.check();
  return device;
}

}  // namespace slambed
