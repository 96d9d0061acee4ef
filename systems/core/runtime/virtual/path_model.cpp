// SPDX-License-Identifier: Apache-2.0
#include "runtime/virtual/path_model.hpp"

#include <utility>

namespace slambed {

PathModel::PathModel(Simulator& simulator, const link::DirectionOptions& options,
                     std::uint64_t seed, std::uint64_t direction)
    : simulator_(simulator), model_(options, seed, direction) {
  model_.start(0);  // the model's clock is the run time
}

Duration PathModel::delay_now() const {
  return Duration(model_.profile_ns(simulator_.now().count()));
}

void PathModel::transmit(std::uint32_t bytes, std::function<void()> on_arrival) {
  const link::PacketOutcome outcome = model_.admit(simulator_.now().count(), bytes);
  if (outcome.fate != link::Fate::kDelivered) {
    ++dropped_;
    return;
  }
  simulator_.at(RunTime(outcome.due_ns), std::move(on_arrival));
}

}  // namespace slambed
