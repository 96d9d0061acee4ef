// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "node/edge_node.hpp"

namespace slambed {

/// Stage `segment` of an edge: a picture's masks, or an event that says why it has none
/// (`segment_failed`). Live, masks that come sooner are held back (`mask_held`), as if a network
/// that takes that long had made them, one picture at a time.
class SegmentationStage {
 public:
  /// bad_input where nothing segments pictures.
  SegmentationStage(EdgeNode& node, Duration floor);

  std::optional<FrameMasks> run(Worker& worker, std::uint64_t frame, const wire::Bytes& jpeg,
                                double threshold);

 private:
  EdgeNode& node_;
  Duration floor_;
};

}  // namespace slambed
