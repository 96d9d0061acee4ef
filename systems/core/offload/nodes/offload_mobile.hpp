// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "offload/channels/offload_channels.hpp"
#include "offload/downlink/map_downlink.hpp"
#include "offload/relocalization/relocalization.hpp"
#include "offload/shutdown/shutdown.hpp"
#include "offload/uplink/keyframe_uplink.hpp"

namespace slambed {

/// Parts of Edge-SLAM's mobile node that a system replaces; not set: as Edge-SLAM does.
struct OffloadMobileParts {
  UpdateApplierMaker applier{};
  MobileRelocalizationMaker relocalization{};
};

/// Edge-SLAM's mobile node without its decisions: keyframe uplink, update downlink, relocalization
/// and shutdown on their channels.
class OffloadMobile {
 public:
  OffloadMobile(MobileNode& node, const Parameters& parameters,
                const OffloadMobileParts& parts = {});

  void start();
  /// Runs between two frames; an update may replace the local map.
  void before_frame(Worker& worker);
  /// Runs between extraction and tracking: sends a lost frame before the local attempt at it.
  void before_tracking(Worker& worker, const OfferedFrame& frame,
                       const std::shared_ptr<const FeatureSet>& features);
  /// Records when a lost camera was relocalized; keyframes within a second of it are marked. Call
  /// it first after each frame.
  void note_relocalization(const TrackedFrame& frame);
  /// Passes the frame to the relocalization, which may ask the edge, suspend or resume.
  void relocalize_after_frame(Worker& worker, const TrackedFrame& frame);
  /// Returns what relocalized the camera in this frame: "edge", "map" or "local".
  std::string_view relocalized_by(const TrackedFrame& frame);
  /// Makes a keyframe of the frame and reports it to the update rules.
  MapDelta create_keyframe(Worker& worker, const TrackedFrame& frame, KeyFrameNeed need,
                           bool becomes_reference);
  /// first: the edge's map starts with it, or this trip in its stored map. whole: `made` has all
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
  double after_relocalization_s_;  ///< keyframes are marked for this long after a relocalization
  bool looks_after_extraction_;    ///< checks for updates after extraction, not before
  double relocalized_s_ = -1;      ///< sequence time of the last relocalization; negative: none
};

}  // namespace slambed
