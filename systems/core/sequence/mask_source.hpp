// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "features/instances.hpp"

namespace slambed {

struct Segmentation {
  std::optional<FrameMasks> masks;  ///< absent if there was no valid answer
  std::string failure;              ///< the reason if masks are absent
};

/// Source of the masks of movable objects. slambed.segment makes all masks. They come from its
/// process on the edge host in live runs, from a cache of its answers in virtual ones.
class MaskSource {
 public:
  virtual ~MaskSource() = default;
  /// Returns the masks of the JPEG as it was sent. threshold: n_m; of two instances that overlap
  /// more than this, one is dropped.
  virtual Segmentation masks(std::uint64_t frame, std::span<const std::uint8_t> jpeg,
                             double threshold) = 0;
  /// Whether answers take the time that the neural network needs on this host.
  virtual bool live() const { return false; }
};

}  // namespace slambed
