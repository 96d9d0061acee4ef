// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "features/keypoint.hpp"

namespace slambed {

/// Hamming distances in bulk, with the processor's popcount where it has one.
struct DescriptorDistance {
  /// out[i] = distance between one and *others[i].
  void (*to_each)(const Descriptor& one, std::span<const Descriptor* const> others,
                  std::uint16_t* out);
  /// out[i] = distance between one and all[which[i]].
  void (*to_some)(const Descriptor& one, const Descriptor* all, std::span<const int> which,
                  std::uint16_t* out);
  /// out[i] = distance between one and all[i].
  void (*to_all)(const Descriptor& one, std::span<const Descriptor> all, std::uint16_t* out);
};

/// The fastest implementation this processor can run; all give the same values.
const DescriptorDistance& descriptor_distance();

}  // namespace slambed
