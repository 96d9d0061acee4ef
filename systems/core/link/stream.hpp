// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/random.hpp"

namespace slambed::link {

/// Packets of the experiment, or echo packets of the harness's probe. Probes have separate random
/// draws and take no space in the queue, so that measuring the link does not change it.
enum class Lane : std::uint8_t { kData = 0, kProbe = 1 };

/// What a stream of random numbers is used for. Each purpose has its own stream, so that enabling
/// one impairment does not change the draws of another.
enum class Purpose : std::uint64_t { kLoss = 1, kLossState = 2, kJitter = 3 };

constexpr SplitMix64 stream(std::uint64_t seed, std::uint64_t direction, Purpose purpose,
                            Lane lane = Lane::kData) {
  direction += 2 * static_cast<std::uint64_t>(lane);
  const std::uint64_t of_direction = mix(seed) ^ (direction * 0xd1342543de82ef95u);
  return SplitMix64(mix(of_direction) ^
                    (static_cast<std::uint64_t>(purpose) * 0x2545f4914f6cdd1du));
}

}  // namespace slambed::link
