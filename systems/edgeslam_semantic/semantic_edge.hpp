// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <memory>
#include <optional>

#include "edgeslam_semantic/labels.hpp"
#include "edgeslam_semantic/map_window.hpp"
#include "edgeslam_semantic/messages.hpp"
#include "edgeslam_semantic/segmentation_stage.hpp"
#include "offload/edge/edge_mapper.hpp"
#include "offload/shutdown/shutdown.hpp"

namespace slambed::edgeslam_semantic {

/// edgeSLAM's edge: maps keyframes and closes loops, segments the pictures on another worker, and
/// answers with a slice of the map and, later, with a mask.
class SemanticEdge final : public EdgePolicy, private ShutdownSource {
 public:
  SemanticEdge(EdgeNode& node, const Parameters& parameters);

  void start() override;
  std::shared_ptr<const Map> map() const override { return mapper_.map(); }

 private:
  struct Picture {
    KeyFrameId map_id, keyframe;
    std::uint64_t frame = 0;
    double n_m = 0;
    Bytes jpeg;
    RunTime arrived{};
  };
  struct Mask {
    KeyFrameId map_id, keyframe;
    FrameMasks masks;
  };

  void receive(Worker& worker);
  void on_keyframe(Worker& worker, SemanticKeyFrame message, const Message& raw);
  std::optional<std::string_view> objection(const SemanticKeyFrame& message) const;
  void answer_probes(Worker& worker);
  void segment(Worker& worker);
  void report_no_mask(KeyFrameId map_id, KeyFrameId keyframe, Duration took, NoMaskReason reason);
  void forget_old_map();
  RunTime idle(Worker& worker);
  void mapped(Worker& worker, const wire::UpdateTimes& times);
  void cull_labeled(Worker& worker);
  void send_slice(Worker& worker, wire::UpdateTimes times);
  std::vector<KeyFrameId> local_keyframes();

  void drain(Worker& worker, std::uint64_t last_sequence, RunTime transit,
             RunTime deadline) override;
  std::vector<KeyFramePose> all_poses() const override { return mapper_.all_poses(); }
  MapCounts counts() const override { return count(*mapper_.map()); }

  EdgeNode& node_;
  int border_px_, window_keyframes_;
  Channel &control_, &frames_, &masks_, &probes_;
  EdgeMapper mapper_;
  EdgeShutdown shutdown_;
  std::optional<SegmentationStage> segmentation_;  ///< only with nrcc
  Mailbox<Picture> pictures_;
  Mailbox<Mask> segmented_;
  std::unique_ptr<Signal> received_;
  std::atomic<std::uint64_t> received_sequence_{0};
  std::atomic<std::uint64_t> map_id_{0};  ///< of the current map
  /// The map was cleared, and the mapping worker has not handled this yet.
  std::atomic<bool> begun_anew_{false};
  KeyFrameId last_map_id_;  ///< of the last accepted keyframe; used by the receiving worker only
  KeyFrameId last_;         ///< last accepted keyframe; used by the receiving worker only

  // Used by the mapping worker only.
  Labels labels_;
  MapWindow window_;   ///< as of the last slice
  KeyFrameId oldest_;  ///< of the window; older keyframes never return to it
  std::uint64_t number_ = 0, sent_corrections_ = 0;
  wire::UpdateTimes times_;  ///< of the keyframe mapped last
};

/// Adapts an upload to the edge's map: fused points get their current ids. Where the edge has since
/// made a point at the same feature of an earlier keyframe, it replaces the mobile's own point.
MapDelta as_known_here(const MapView& view, MapDelta delta);

}  // namespace slambed::edgeslam_semantic
