// SPDX-License-Identifier: Apache-2.0
#include "runtime/cost_model.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "base/portable_math.hpp"
#include "runtime/keyed_random.hpp"

namespace slambed {
void DeviceModel::check() const {
  const auto good = [](double x) { return std::isfinite(x) && x >= 0; };
  if (cores < 1) throw bad_input("device: cores must be at least 1");
  if (!std::isfinite(speed) || speed <= 0) throw bad_input("device: speed must be above 0");
  if (!good(background)) throw bad_input("device: background must be 0 or more");
  for (const auto& [name, accelerator] : accelerators) {
    if (accelerator.lanes < 1 || !std::isfinite(accelerator.speed) || accelerator.speed <= 0) {
      throw bad_input("device: accelerator " + name + ": lanes must be at least 1, speed above 0");
    }
  }
  for (const auto& [name, cost] : stages) {
    if (!cost.accelerator.empty() && !accelerators.contains(cost.accelerator)) {
      throw bad_input("device: stage " + name + " is done by '" + cost.accelerator +
                      "', which is none of its accelerators");
    }
    if (!good(cost.a_us) || !good(cost.b_us) || !good(cost.c_us) || !good(cost.jitter)) {
      throw bad_input("device: stage " + name + ": costs and jitter must be 0 or more");
    }
  }
}

const StageCost& DeviceModel::cost(std::string_view stage) const {
  const auto found = stages.find(stage);
  if (found == stages.end()) {
    throw bad_input("device: no cost for stage '" + std::string(stage) +
                    "'; add it to the device file's stages, or to the system's (cost_as)");
  }
  return found->second;
}

Duration DeviceModel::charge(std::string_view stage, const StageUnits& units, std::uint64_t seed,
                             std::uint64_t count) const {
  const StageCost& cost = this->cost(stage);
  const double faster =
      cost.accelerator.empty() ? speed : accelerators.find(cost.accelerator)->second.speed;
  double us = (cost.a_us + cost.b_us * units.n1 + cost.c_us * units.n2) / faster;
  if (cost.jitter > 0) {
    us *= portable::exp(cost.jitter * keyed_normal(mix(mix(seed ^ hash_name(stage)) + count)));
  }
  return Duration(std::max<std::int64_t>(0, std::llround(us * 1e3)));
}

}  // namespace slambed
