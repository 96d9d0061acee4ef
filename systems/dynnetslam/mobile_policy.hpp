// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "dynnetslam/strategy.hpp"
#include "dynnetslam/switched_mapping.hpp"

namespace slambed::dynnetslam {

/// Decides by the RTT where mapping runs: before each keyframe is made, or when the last decision
/// was too long ago.
class DynNetSlamMobile final : public MobilePolicy {
 public:
  DynNetSlamMobile(MobileNode& node, const Parameters& parameters);

  void start() override { mapping_.start(); }
  void before_frame(Worker& worker, const OfferedFrame&) override { mapping_.before_frame(worker); }
  void after_frame(Worker& worker, const TrackedFrame& frame) override;
  void finish(Worker& worker) override { mapping_.finish(worker); }
  void place_keyframes(PoseBook& book) override { mapping_.place_keyframes(book); }
  MapCounts counts() const override { return mapping_.counts(); }

 private:
  void decide(Worker& worker);
  void change_state(Worker& worker, OffloadingState next, std::optional<Duration> rtt);

  MobileNode& node_;
  Thresholds thresholds_;
  Duration decision_gap_;
  SwitchedMapping mapping_;

  // Used by the tracking worker only.
  OffloadingState state_ = OffloadingState::kOffloading;
  bool decided_ = false;  ///< the first decision was made
  RunTime last_decision_{};
};

}  // namespace slambed::dynnetslam
