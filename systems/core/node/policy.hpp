// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "node/counts.hpp"
#include "node/frame_tracking.hpp"
#include "node/parameters.hpp"
#include "runtime/network.hpp"
#include "wire/message_type.hpp"

namespace slambed {

class MobileNode;
class EdgeNode;

/// A system's decisions on the mobile node, which it carries out through MobileNode. Calls come
/// from the tracking worker unless stated otherwise.
class MobilePolicy : public TrackingPolicy {
 public:
  /// Before the run: spawn workers.
  virtual void start() {}
  /// Called between two frames, when an update may change the map.
  virtual void before_frame(Worker&, const OfferedFrame&) {}
  /// Sends a frame that the other node tracks and returns true. False: the frame is tracked here,
  /// with calls of before_tracking and after_frame.
  virtual bool offload(Worker&, const OfferedFrame&) { return false; }
  /// Called when playback is over: drains the queues, then does the shutdown exchange with the
  /// peer.
  virtual void finish(Worker& worker) = 0;
  /// Called after all workers have ended: enters the keyframe poses that it knows.
  virtual void place_keyframes(PoseBook& book) = 0;
  /// Size of the global map, as far as this node knows it.
  virtual MapCounts counts() const = 0;
};

/// A system's decisions on the edge node.
class EdgePolicy {
 public:
  virtual ~EdgePolicy() = default;
  /// Before the run: spawn workers. The run ends when one of them calls EdgeNode::end.
  virtual void start() = 0;
  /// The global map.
  virtual std::shared_ptr<const Map> map() const = 0;
  /// Called after all workers have ended: writes files into the node's folder.
  virtual void leave(const std::filesystem::path&) {}
};

/// A system as the programs see it. Its factories run before the start because they open channels.
struct System {
  std::string name;
  std::vector<ParameterSpec> parameters;
  std::vector<std::string> channels;  ///< none: everything runs on the mobile
  /// Types of the system's own messages, from 128 on (docs/how-to/write-a-system-in-cpp.md).
  std::vector<wire::MessageRange> messages;
  std::vector<SensorKind> sensors{SensorKind::kRgbd};
  std::function<OrbOptions(const Parameters&)> orb;
  std::function<TrackerOptions(const Parameters&)> tracker;
  std::function<bool(const Parameters&)> sequential;  ///< plays as fast as tracking permits
  /// Map file that the mobile node starts in; empty: none. Not set: never any.
  std::function<std::string(const Parameters&)> prior_map;
  /// Whether the mobile node saves its map as a file; not set: never.
  std::function<bool(const Parameters&)> save_map;
  /// Numbers of octaves that the mobile may switch to (MobileNode::use_levels); not set: always
  /// those of `orb`.
  std::function<std::vector<int>(const Parameters&)> orb_levels;
  /// JPEG quality of the pictures for the edge; not set: none are sent.
  std::function<int(const Parameters&)> jpeg_quality;
  /// Whether features are extracted on the edge, from those pictures; not set: on the mobile.
  std::function<bool(const Parameters&)> extracts_on_edge;
  std::function<std::unique_ptr<MobilePolicy>(MobileNode&, const Parameters&)> mobile;
  std::function<std::unique_ptr<EdgePolicy>(EdgeNode&, const Parameters&)> edge;
};

}  // namespace slambed
