// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "node/local_mapping.hpp"
#include "node/mobile_node.hpp"
#include "slam/pose_correction.hpp"
#include "wire/trip_messages.hpp"

namespace slambed {

/// Applies poses that the edge found for this trip's keyframes to the local map. Call it on the
/// tracking worker, between two frames.
class PoseUpdates {
 public:
  PoseUpdates(MobileNode& node, LocalMapping& mapping, CorrectionWindow window)
      : node_(node), mapping_(mapping), window_(window) {}

  /// Corrects the map if the pose is valid, is of a keyframe of this map, and is newer than the
  /// last one applied. Logs the outcome and returns the correction, if any. whole_map: the whole
  /// map moves, and no pose is too old.
  std::optional<PoseCorrection> apply(Worker& worker, const Message& raw, bool whole_map,
                                      double seq_s);

 private:
  std::optional<std::string_view> objection(const wire::PoseAnswer& answer, bool whole_map) const;
  PoseCorrection correct(Worker& worker, const wire::PoseAnswer& answer, bool whole_map);

  MobileNode& node_;
  LocalMapping& mapping_;
  CorrectionWindow window_;
  KeyFrameId applied_;  ///< newest keyframe with an applied pose
};

}  // namespace slambed
