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
/// applies what comes from it between two frames.
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
  /// What an upload still waits for.
  struct Waiting {
    bool result = true, mask = true;
    RunTime since{};
  };
  /// When the parts of the frame at hand ended.
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
  Mailbox<std::uint64_t> refusals_;  ///< of uploads, by their numbers

  int row_ = kRows;
  Configuration configuration_;
  FrameFacts facts_;
  std::map<KeyFrameId, Waiting> waiting_;  ///< uploads whose answers are not all back
  std::uint64_t edge_session_ = 0;         ///< of the edge that this map went to
  bool edge_lacks_map_ = false;            ///< it has told that it has no beginning of it
  bool unanswered_ = false;                ///< an upload had no result in time, and none since
  Moments moments_;
  int features_ = 0;  ///< of the frame at hand, before culling
};

}  // namespace slambed::edgeslam_semantic
