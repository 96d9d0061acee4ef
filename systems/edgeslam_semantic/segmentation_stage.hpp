// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "node/edge_node.hpp"

namespace slambed {

/// Stage `segment` of an edge. Without masks it logs the reason (`segment_failed`). In live runs it
/// holds masks back until `floor` has passed (`mask_held`), one picture at a time, which imitates
/// the duration of the paper's slower network.
class SegmentationStage {
 public:
  /// Throws bad_input if the node has no segmenter.
  SegmentationStage(EdgeNode& node, Duration floor);

  std::optional<FrameMasks> run(Worker& worker, std::uint64_t frame, const wire::Bytes& jpeg,
                                double threshold);

 private:
  EdgeNode& node_;
  Duration floor_;
};

}  // namespace slambed
