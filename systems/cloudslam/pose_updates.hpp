// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "node/local_mapping.hpp"
#include "node/mobile_node.hpp"
#include "slam/pose_correction.hpp"
#include "wire/trip_messages.hpp"

namespace slambed {

/// Poses that an edge found for this trip's keyframes, and what they do to the local map. All on
/// the tracking worker, between two frames.
class PoseUpdates {
 public:
  PoseUpdates(MobileNode& node, LocalMapping& mapping, CorrectionWindow window)
      : node_(node), mapping_(mapping), window_(window) {}

  /// Corrects the map where the message may be believed: newer than the last one that was applied,
  /// of a keyframe of this map, a pose at all. Writes what became of it; the correction, if any.
  /// whole_map: everything moves, and nothing is too old.
  std::optional<PoseCorrection> apply(Worker& worker, const Message& raw, bool whole_map,
                                      double seq_s);

 private:
  std::optional<std::string_view> objection(const wire::PoseAnswer& answer, bool whole_map) const;
  PoseCorrection correct(Worker& worker, const wire::PoseAnswer& answer, bool whole_map);

  MobileNode& node_;
  LocalMapping& mapping_;
  CorrectionWindow window_;
  KeyFrameId applied_;  ///< the newest
};

}  // namespace slambed
