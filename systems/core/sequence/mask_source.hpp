// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "features/instances.hpp"

namespace slambed {

/// What a segmentation made of a picture.
struct Segmentation {
  std::optional<FrameMasks> masks;  ///< none: it gave no answer that can be used
  std::string failure;              ///< then: why
};

/// The segmentation: what moves in a picture. One implementation makes all masks (slambed.segment);
/// here is where they come from, a process beside the edge when live, a cache of its answers when
/// virtual.
class MaskSource {
 public:
  virtual ~MaskSource() = default;
  /// Of the picture as it was sent. threshold: n_m, above which overlap one of two instances goes.
  virtual Segmentation masks(std::uint64_t frame, std::span<const std::uint8_t> jpeg,
                             double threshold) = 0;
  /// Whether an answer takes as long as the network that is at hand takes on this host.
  virtual bool live() const { return false; }
};

}  // namespace slambed
