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
  std::filesystem::path prior_map{};  ///< file of the initial global map; empty: none
  bool admission_when_idle = false;   ///< keyframes wait unparsed until the mapper looks
};

/// Edge-SLAM's edge: keyframe intake, mapper and update sender put together.
class EdgeMapping final : public ShutdownSource {
 public:
  /// Throws bad_input for a prior map that is missing, damaged or empty. After start(), a mobile
  /// with another camera than the map's is bad_input, too.
  EdgeMapping(EdgeNode& node, const EdgeMappingOptions& options, Channel& keyframes, Channel& map);

  void start();
  EdgeMapper& mapper() { return mapper_; }
  const EdgeMapper& mapper() const { return mapper_; }
  UpdateSender& updates() { return updates_; }
  /// Answers keyframes that cannot start a map with KEYFRAME_WANTED. Call before start().
  void ask_when_empty() { intake_.ask_when_empty(); }

  void drain(Worker& worker, std::uint64_t last_sequence, RunTime transit,
             RunTime deadline) override;
  std::vector<KeyFramePose> all_poses() const override { return mapper_.all_poses(); }
  MapCounts counts() const override { return count(*mapper_.map()); }

  /// Pauses mapping: no keyframe is admitted and no map is sent, not even for relocalization. The
  /// keyframe that is being mapped is finished.
  void stop();
  /// Resumes mapping; maps sent from now on carry the epoch.
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
