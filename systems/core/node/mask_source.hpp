// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "features/instances.hpp"

namespace slambed {

/// The segmentation: what moves in a picture. One implementation makes all masks (slambed.segment);
/// here is where they come from, a process beside the edge when live, a cache of its answers when
/// virtual.
class MaskSource {
 public:
  virtual ~MaskSource() = default;
  /// Of the picture as it was sent. threshold: n_m, above which overlap one of two instances goes.
  /// Throws Error(kBadInput) where there are no masks for it.
  virtual FrameMasks masks(std::uint64_t frame, std::span<const std::uint8_t> jpeg,
                           double threshold) = 0;
};

}  // namespace slambed
