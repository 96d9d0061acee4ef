// SPDX-License-Identifier: Apache-2.0
#include "runtime/virtual/cost_model.hpp"

#include <algorithm>
#include <cmath>

#include "base/error.hpp"
#include "runtime/virtual/random.hpp"

namespace slambed {
void DeviceModel::check() const {
  const auto good = [](double x) { return std::isfinite(x) && x >= 0; };
  if (cores < 1) throw bad_input("device: cores must be at least 1");
  if (!std::isfinite(speed) || speed <= 0) throw bad_input("device: speed must be above 0");
  for (const auto& [name, cost] : stages) {
    if (!good(cost.a_us) || !good(cost.b_us) || !good(cost.c_us) || !good(cost.jitter)) {
      throw bad_input("device: stage " + name + ": costs and jitter must be 0 or more");
    }
  }
}

const StageCost& DeviceModel::cost(std::string_view stage) const {
  const auto found = stages.find(stage);
  if (found == stages.end()) {
    throw bad_input("device: no cost for stage '" + std::string(stage) +
                    "'; add it to the device file's stages");
  }
  return found->second;
}

Duration DeviceModel::charge(std::string_view stage, const StageUnits& units, std::uint64_t seed,
                             std::uint64_t count) const {
  const StageCost& cost = this->cost(stage);
  double us = (cost.a_us + cost.b_us * units.n1 + cost.c_us * units.n2) / speed;
  if (cost.jitter > 0) {
    us *= portable_exp(cost.jitter * normal(mix(mix(seed ^ hash_name(stage)) + count)));
  }
  return Duration(std::max<std::int64_t>(0, std::llround(us * 1e3)));
}

}  // namespace slambed
