// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>

#include "edgeslam_semantic/configuration.hpp"
#include "edgeslam_semantic/mask_transfer.hpp"
#include "edgeslam_semantic/mobile_map.hpp"
#include "edgeslam_semantic/uploads.hpp"
#include "offload/shutdown/shutdown.hpp"

namespace slambed::edgeslam_semantic {

/// edgeSLAM's mobile: tracks every frame against a rough local map, never waits for the edge, and
/// applies the edge's answers between two frames.
class SemanticMobile final : public MobilePolicy {
 public:
  SemanticMobile(MobileNode& node, const Parameters& parameters);

  void start() override;
  void before_frame(Worker& worker, const OfferedFrame& frame) override;
  std::shared_ptr<const FeatureSet> before_tracking(
      Worker& worker, const OfferedFrame& frame,
      std::shared_ptr<const FeatureSet> features) override;
  void after_frame(Worker& worker, const TrackedFrame& frame) override;
  void finish(Worker& worker) override;
  void place_keyframes(PoseBook& book) override;
  MapCounts counts() const override { return shutdown_.counts(); }

 private:
  /// The answers that an upload still waits for.
  struct Waiting {
    bool result = true, mask = true;
    RunTime since{};
  };
  /// When each part of the current frame's work ended.
  struct Moments {
    RunTime updated{}, extracted{}, culled{};
  };

  void receive_results(Worker& worker);
  void receive_masks(Worker& worker);
  void on_result(Worker& worker, const OptResult& result);
  void on_mask(Worker& worker, const MaskMessage& mask);
  void on_no_mask(const NoMaskMessage& missing);
  void refused(std::uint64_t sequence);
  void no_longer_waits_for_mask(KeyFrameId keyframe);
  void forget_answered(RunTime now);
  void log_features(const OfferedFrame& frame, const FeatureSet& features) const;
  void report(Worker& worker, const TrackedFrame& frame);
  std::optional<std::string_view> begin_anew() const;
  std::optional<std::string_view> choose();
  void configure();
  void make_keyframe(Worker& worker, const TrackedFrame& frame,
                     std::optional<std::string_view> reason);
  void reset();

  MobileNode& node_;
  bool nrcc_, by_table_, local_references_, record_culling_;
  int fixed_row_, most_under_way_;
  double n_m_;
  Channel &control_, &frames_, &masks_, &probes_;
  MobileShutdown shutdown_;
  Uploads uploads_;
  MobileMap map_;
  MaskTransfer transfer_;
  Mailbox<OptResult> results_;
  Mailbox<MaskMessage> arrived_masks_;
  Mailbox<NoMaskMessage> missing_masks_;
  Mailbox<std::uint64_t> refusals_;  ///< sequence numbers of refused uploads

  int row_ = kDefaultRow;
  Configuration configuration_;
  FrameFacts facts_;
  std::size_t next_place_ = 0;             ///< of the frame after the last one tracked
  std::map<KeyFrameId, Waiting> waiting_;  ///< uploads that still wait for an answer
  std::uint64_t edge_session_ = 0;         ///< of the edge that got this map's first upload
  bool edge_lacks_map_ = false;            ///< the edge did not get this map's first upload
  bool unanswered_ = false;                ///< an upload timed out, and no slice came since
  Moments moments_;
  int features_ = 0;  ///< of the current frame, before culling
};

}  // namespace slambed::edgeslam_semantic
