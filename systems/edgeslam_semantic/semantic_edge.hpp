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

/// edgeSLAM's edge: maps keyframes and closes loops at once, segments their pictures beside that,
/// and answers with a slice of the map and, later, with a mask.
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
  std::optional<SegmentationStage> segmentation_;  ///< with nrcc
  Mailbox<Picture> pictures_;
  Mailbox<Mask> segmented_;
  std::unique_ptr<Signal> received_;
  std::atomic<std::uint64_t> received_sequence_{0};
  std::atomic<std::uint64_t> map_id_{0};  ///< of the map at hand
  /// The map was cleared; the mapping worker has to hear of it.
  std::atomic<bool> begun_anew_{false};
  KeyFrameId last_map_id_;  ///< received; of the receiving worker
  KeyFrameId last_;         ///< received; of the receiving worker

  // Of the mapping worker.
  Labels labels_;
  MapWindow window_;   ///< as the last slice told it
  KeyFrameId oldest_;  ///< no keyframe comes back into the window
  std::uint64_t number_ = 0, sent_corrections_ = 0;
  wire::UpdateTimes times_;  ///< of the keyframe mapped last
};

/// A keyframe as it fits the edge's map: known points by the names they have there now, and points
/// of the mobile's own that the edge has made meanwhile (the same feature of an earlier keyframe)
/// by the edge's.
MapDelta as_known_here(const MapView& view, MapDelta delta);

}  // namespace slambed::edgeslam_semantic
