// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "offload/channels/offload_channels.hpp"
#include "offload/edge/edge_mapping.hpp"
#include "offload/relocalization/relocalization.hpp"
#include "offload/shutdown/shutdown.hpp"

namespace slambed {

/// Parts of Edge-SLAM's edge node that a system replaces.
struct OffloadEdgeParts {
  EdgeRelocalizationMaker relocalization{};  ///< not set: as Edge-SLAM does
  bool keep_recovery = false;                ///< see UpdateSender::recovered
};

class OffloadEdge {
 public:
  OffloadEdge(EdgeNode& node, const Parameters& parameters, const OffloadEdgeParts& parts = {});

  void start();
  std::shared_ptr<const Map> map() const { return mapping_.mapper().map(); }
  EdgeMapping& mapping() { return mapping_; }

 private:
  MessageCodec codec_;
  OffloadChannels channels_;
  EdgeMapping mapping_;
  std::unique_ptr<EdgeRelocalization> relocalization_;
  EdgeShutdown shutdown_;
};

}  // namespace slambed
