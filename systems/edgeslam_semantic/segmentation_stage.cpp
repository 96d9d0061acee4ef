// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/segmentation_stage.hpp"

#include "base/error.hpp"

namespace slambed {

SegmentationStage::SegmentationStage(EdgeNode& node, Duration floor) : node_(node), floor_(floor) {
  if (node_.masks() == nullptr)
    throw bad_input(
        "params: nrcc is on and nothing segments the pictures; give masks, or turn it off");
}

std::optional<FrameMasks> SegmentationStage::run(Worker& worker, std::uint64_t frame,
                                                 const wire::Bytes& jpeg, double threshold) {
  const RunTime asked = worker.now();
  Segmentation answer = worker.stage("segment", [&](StageUnits& units) {
    units.n1 = static_cast<double>(jpeg.size()) / 1000;
    return node_.masks()->masks(frame, jpeg, threshold);
  });
  if (!answer.masks) {
    node_.log().write(JsonLine("segment_failed").add("frame", frame).add("reason", answer.failure));
    return std::nullopt;
  }
  if (!node_.masks()->live()) return std::move(answer.masks);
  const Duration took = worker.now() - asked;
  worker.sleep_until(asked + floor_);
  node_.log().write(JsonLine("mask_held")
                        .add("frame", frame)
                        .add_ms("took_ms", took)
                        .add_ms("held_ms", worker.now() - asked - took));
  return std::move(answer.masks);
}

}  // namespace slambed
