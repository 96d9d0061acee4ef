// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/culling_by_age.hpp"

#include "edgeslam_semantic/labels.hpp"

namespace slambed::edgeslam_semantic {
namespace {

/// A frame's features and the truth about them.
struct LabeledFrame {
  std::shared_ptr<const FeatureSet> features;
  std::vector<std::uint8_t> on_mover, near_mover;
};

void count(const LabeledFrame& frame, const std::vector<std::uint8_t>& free,
           CullingCounts& counts) {
  for (std::size_t i = 0; i < free.size(); ++i) {
    const bool culled = !free[i];
    counts.culled += culled;
    counts.rightly += culled && frame.near_mover[i];
    counts.on_movers += frame.on_mover[i];
    counts.found += culled && frame.on_mover[i];
  }
}

}  // namespace

std::vector<CullingCounts> culling_by_age(const CullingSequence& sequence,
                                          const CullingOptions& options) {
  std::vector<LabeledFrame> frames;
  for (std::uint64_t i = 0; i < sequence.frames; ++i) {
    LabeledFrame known{.features = sequence.features(i), .on_mover = {}, .near_mover = {}};
    const FrameMasks truth = sequence.truth(i);
    known.on_mover = features_on_masks(*known.features, truth, 0);
    known.near_mover = features_on_masks(*known.features, truth, options.labels.border_px);
    frames.push_back(std::move(known));
  }
  std::vector<CullingCounts> by_age(static_cast<std::size_t>(options.oldest) + 1);
  const std::size_t step = static_cast<std::size_t>(options.every);
  for (std::size_t first = 0; first < frames.size(); first += step) {
    MaskTransfer transfer(options.labels, options.tracks);
    const KeyFrameId id{first + 1};
    for (std::size_t age = 0; age < by_age.size() && first + age < frames.size(); ++age) {
      const LabeledFrame& frame = frames[first + age];
      transfer.track(frame.features, static_cast<double>(first + age) / sequence.fps);
      if (age == 0) transfer.keep(id);
      if (age == static_cast<std::size_t>(options.late)) transfer.apply(id, sequence.masks(first));
      count(frame, transfer.free(), by_age[age]);
    }
  }
  return by_age;
}

}  // namespace slambed::edgeslam_semantic
