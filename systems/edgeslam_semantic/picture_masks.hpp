// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "edgeslam_semantic/segmentation_stage.hpp"
#include "runtime/mailbox.hpp"

namespace slambed {

struct PictureMasksOptions {
  double threshold;  ///< n_m
  int border_px;     ///< features so near to a mask lie on it
  Duration floor;    ///< live, no mask comes sooner after its picture
};

/// NRCC ("non-rigid context culling") on a worker of its own, so that a picture is segmented (stage
/// `segment`) while it is extracted; then leaves out the features on what moves (stage
/// `cull_features`).
class PictureMasks {
 public:
  struct Answer {
    bool segmented = false;  ///< not: segmentation failed, or the run stops
    FrameMasks masks;        ///< of no size where it is not segmented
    Duration took{};         ///< from the time that ask was told
  };

  /// bad_input where nothing segments pictures.
  PictureMasks(EdgeNode& node, PictureMasksOptions options);

  void start();
  /// Asks for the masks of a picture. since: when work on the picture began.
  void ask(std::uint64_t frame, wire::Bytes jpeg, RunTime since);
  /// Of the picture asked for last.
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
