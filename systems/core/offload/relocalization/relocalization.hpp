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

/// Relocalizes a lost camera with the edge's help: by a map in which the mobile relocalizes itself
/// (Edge-SLAM), or by a pose that the edge finds (systems/multithread_rl). This is the mobile's
/// side; it runs on the tracking worker.
class MobileRelocalization {
 public:
  virtual ~MobileRelocalization() = default;
  virtual void start() {}
  /// Runs between two frames; an answer may take effect.
  virtual void before_frame(Worker&) {}
  /// Runs between extraction and tracking, before the local attempt to relocalize a lost frame.
  virtual void before_tracking(Worker&, const OfferedFrame&,
                               const std::shared_ptr<const FeatureSet>&) {}
  virtual void after_frame(Worker& worker, const TrackedFrame& frame) = 0;
  /// Playback is over: releases what an unfinished loss holds back.
  virtual void finish() {}
};

/// The edge's side of relocalization.
class EdgeRelocalization {
 public:
  virtual ~EdgeRelocalization() = default;
  virtual void start() = 0;
  /// Receives messages on the control channel other than the mobile's BYE. May run on any worker.
  virtual void listen(const Message&) {}
};

/// Make the relocalization that a system has chosen. All arguments must outlive it.
using MobileRelocalizationMaker = std::function<std::unique_ptr<MobileRelocalization>(
    MobileNode&, OffloadChannels&, MapDownlink&, const MessageCodec&)>;
using EdgeRelocalizationMaker = std::function<std::unique_ptr<EdgeRelocalization>(
    EdgeNode&, OffloadChannels&, EdgeMapping&, const MessageCodec&)>;

}  // namespace slambed
