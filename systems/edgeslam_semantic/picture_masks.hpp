// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "edgeslam_semantic/segmentation_stage.hpp"
#include "runtime/mailbox.hpp"

namespace slambed {

struct PictureMasksOptions {
  double threshold;  ///< n_m
  int border_px;     ///< features within this distance of a mask count as on it
  Duration floor;    ///< least duration of a segmentation in live runs
};

/// NRCC ("non-rigid context culling"). A separate worker segments a picture (stage `segment`) while
/// its features are extracted; cull() then drops the features on what moves (stage
/// `cull_features`).
class PictureMasks {
 public:
  struct Answer {
    bool segmented = false;  ///< false: segmentation failed, or the run stops
    FrameMasks masks;        ///< empty and of size 0 if not segmented
    Duration took{};         ///< since ask()'s `since`
  };

  /// Throws bad_input if the node has no segmenter.
  PictureMasks(EdgeNode& node, PictureMasksOptions options);

  void start();
  /// Requests the masks of a picture. since: when work on the picture began.
  void ask(std::uint64_t frame, wire::Bytes jpeg, RunTime since);
  /// Waits for the answer to the oldest pending request.
  Answer wait(Worker& worker);
  std::shared_ptr<const FeatureSet> cull(Worker& worker, std::shared_ptr<const FeatureSet> features,
                                         const FrameMasks& masks) const;

 private:
  struct Picture {
    std::uint64_t frame = 0;
    wire::Bytes jpeg;
    RunTime since{};
  };

  void work(Worker& worker);

  EdgeNode& node_;
  PictureMasksOptions options_;
  SegmentationStage segmentation_;
  Mailbox<Picture> asked_;
  Mailbox<Answer> answers_;
};

}  // namespace slambed
