// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fstream>
#include <regex>
#include <string>

#include "base/error.hpp"
#include "runtime/cost_model.hpp"

namespace slambed::testing {

/// Reads the cost model in catalog/devices/NAME.yaml, as the harness passes it to virtual runs.
/// Accepts only the format that `slambed calibrate` writes, one line per stage.
inline DeviceModel fitted_device(const std::string& folder, const std::string& name) {
  const std::string path = folder + "/" + name + ".yaml";
  std::ifstream file(path);
  const std::regex stage(R"(    (\w+): +\{(.*)\})");
  const std::regex cost(R"((a_us|b_us|c_us|jitter): ([0-9.]+))");
  const std::regex cores(R"(  cores: (\d+))");
  DeviceModel device;
  bool model = false;
  for (std::string line; std::getline(file, line);) {
    model = model || line == "model:";
    std::smatch found;
    if (model && std::regex_match(line, found, cores)) device.cores = std::stoi(found[1]);
    if (!model || !std::regex_match(line, found, stage)) continue;
    StageCost& costs = device.stages[found[1]];
    const std::string fields = found[2];
    for (std::sregex_iterator field(fields.begin(), fields.end(), cost), end; field != end;
         ++field) {
      const std::string what = (*field)[1];
      const double value = std::stod((*field)[2]);
      (what == "a_us"   ? costs.a_us
       : what == "b_us" ? costs.b_us
       : what == "c_us" ? costs.c_us
                        : costs.jitter) = value;
    }
  }
  if (device.stages.empty()) throw bad_input(path + ": no stages; is it a fitted device?");
  return device;
}

}  // namespace slambed::testing
