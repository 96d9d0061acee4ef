// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "offload/edge/edge_mapper.hpp"
#include "offload/edge/update_sender.hpp"
#include "offload/maps/prior_map.hpp"
#include "offload/shutdown/shutdown.hpp"
#include "offload/uplink/keyframe_intake.hpp"

namespace slambed {

struct EdgeMappingOptions {
  EdgeMapperOptions mapper;
  UpdateSenderOptions updates;
  std::filesystem::path prior_map{};  ///< what the global map begins with; empty: nothing
  bool admission_when_idle = false;   ///< keyframes wait unread until the mapper looks for one
};

/// Edge-SLAM's edge: keyframe intake, mapper and update sender put together.
class EdgeMapping final : public ShutdownSource {
 public:
  /// bad_input for a prior map that is missing, damaged, empty, or of another camera than the
  /// mobile's.
  EdgeMapping(EdgeNode& node, const EdgeMappingOptions& options, Channel& keyframes, Channel& map);

  void start();
  EdgeMapper& mapper() { return mapper_; }
  const EdgeMapper& mapper() const { return mapper_; }
  UpdateSender& updates() { return updates_; }
  /// Answers keyframes that no map can start with by KEYFRAME_WANTED. Before start().
  void ask_when_empty() { intake_.ask_when_empty(); }

  void drain(Worker& worker, std::uint64_t last_sequence, RunTime transit,
             RunTime deadline) override;
  std::vector<KeyFramePose> all_poses() const override { return mapper_.all_poses(); }
  MapCounts counts() const override { return count(*mapper_.map()); }

  /// Mapping rests: no keyframe is admitted, no map leaves, of any kind. What is being mapped is
  /// finished.
  void stop();
  /// Maps again; maps that leave carry the epoch.
  void resume(std::uint64_t epoch);

 private:
  void check_prior(Worker& worker);

  EdgeNode& node_;
  std::optional<PriorMap> prior_;
  EdgeMapper mapper_;
  UpdateSender updates_;
  KeyFrameIntake intake_;
};

}  // namespace slambed
