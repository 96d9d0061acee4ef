// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>

#include "node/frame_tracking.hpp"
#include "runtime/channel.hpp"

namespace slambed {

class EdgeMapping;
class EdgeNode;
class MapDownlink;
class MessageCodec;
class MobileNode;
class OffloadChannels;

/// How a lost camera is found with the edge's help: by a map in which the mobile finds itself
/// (Edge-SLAM), or by a pose that the edge has found (systems/multithread_rl). This is the mobile's
/// side, on the tracking worker.
class MobileRelocalization {
 public:
  virtual ~MobileRelocalization() = default;
  virtual void start() {}
  /// Between two frames: an answer may take effect.
  virtual void before_frame(Worker&) {}
  /// Between extraction and tracking: before the local attempt at a lost frame.
  virtual void before_tracking(Worker&, const OfferedFrame&,
                               const std::shared_ptr<const FeatureSet>&) {}
  virtual void after_frame(Worker& worker, const TrackedFrame& frame) = 0;
  /// Playback is over: a loss that has not ended holds nothing back any more.
  virtual void finish() {}
};

/// The edge's side.
class EdgeRelocalization {
 public:
  virtual ~EdgeRelocalization() = default;
  virtual void start() = 0;
  /// What comes on the control channel and is not the mobile's BYE. On any worker.
  virtual void listen(const Message&) {}
};

/// Make what a system has chosen; all that they are given outlives it.
using MobileRelocalizationMaker = std::function<std::unique_ptr<MobileRelocalization>(
    MobileNode&, OffloadChannels&, MapDownlink&, const MessageCodec&)>;
using EdgeRelocalizationMaker = std::function<std::unique_ptr<EdgeRelocalization>(
    EdgeNode&, OffloadChannels&, EdgeMapping&, const MessageCodec&)>;

}  // namespace slambed
