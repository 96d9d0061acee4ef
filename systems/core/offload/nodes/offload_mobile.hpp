// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "offload/channels/offload_channels.hpp"
#include "offload/downlink/map_downlink.hpp"
#include "offload/relocalization/relocalization.hpp"
#include "offload/shutdown/shutdown.hpp"
#include "offload/uplink/keyframe_uplink.hpp"

namespace slambed {

/// What a system does otherwise than Edge-SLAM on the mobile node; not set: as Edge-SLAM does.
struct OffloadMobileParts {
  UpdateApplierMaker applier{};
  MobileRelocalizationMaker relocalization{};
};

/// Edge-SLAM's mobile node without its decisions: keyframes up, updates down, relocalization and
/// shutdown on their channels.
class OffloadMobile {
 public:
  OffloadMobile(MobileNode& node, const Parameters& parameters,
                const OffloadMobileParts& parts = {});

  void start();
  /// Between two frames: an update may replace the local map.
  void before_frame(Worker& worker);
  /// Between extraction and tracking: a lost frame goes to the edge before the local attempt at it.
  void before_tracking(Worker& worker, const OfferedFrame& frame,
                       const std::shared_ptr<const FeatureSet>& features);
  /// Remembers when a lost camera was found: keyframes within a second say so. First thing after
  /// each frame.
  void note_relocalization(const TrackedFrame& frame);
  /// Lets the relocalization see the frame: by map it asks the edge, by pose it suspends and
  /// resumes.
  void relocalize_after_frame(Worker& worker, const TrackedFrame& frame);
  /// With whose help a lost camera was found in this frame.
  std::string_view relocalized_by(const TrackedFrame& frame);
  /// Makes a keyframe of the frame; the update rules hear of it.
  MapDelta create_keyframe(Worker& worker, const TrackedFrame& frame, KeyFrameNeed need,
                           bool becomes_reference);
  /// first: the edge's map begins with it, or this trip in its stored one; whole: made has all
  /// points that the keyframe sees.
  void send(Worker& worker, const TrackedFrame& frame, MapDelta made, KeyFrameNeed need, bool first,
            bool whole);
  void shut_down(Worker& worker);

  OffloadChannels& channels() { return channels_; }
  MapDownlink& downlink() { return downlink_; }
  const MobileShutdown& shutdown() const { return shutdown_; }

 private:
  void leave_out_past_probation(MapDelta& made) const;

  MobileNode& node_;
  MessageCodec codec_;
  OffloadChannels channels_;
  MapDownlink downlink_;
  MobileShutdown shutdown_;
  KeyFrameUplink uplink_;
  std::unique_ptr<MobileRelocalization> relocalization_;
  double after_relocalization_s_;  ///< so long keyframes say that a relocalization was before them
  bool looks_after_extraction_;    ///< for an update, not before
  double relocalized_s_ = -1;      ///< sequence time of the last relocalization; negative: none
};

}  // namespace slambed
