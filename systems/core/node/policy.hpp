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

/// What a system decides on the mobile node. Calls come from the tracking worker unless said
/// otherwise; the verbs to act with are MobileNode's.
class MobilePolicy : public TrackingPolicy {
 public:
  /// Before the run: spawn workers.
  virtual void start() {}
  /// Between two frames: the place where an update may change the map.
  virtual void before_frame(Worker&, const OfferedFrame&) {}
  /// A frame that is tracked on the other node: sends it there and returns true. False: it is
  /// tracked here, and before_tracking and after_frame are called.
  virtual bool offload(Worker&, const OfferedFrame&) { return false; }
  /// Playback is over: drains what is queued, then goes through the shutdown exchange with the
  /// peer.
  virtual void finish(Worker& worker) = 0;
  /// After all workers have ended: enters the keyframe poses it knows of.
  virtual void place_keyframes(PoseBook& book) = 0;
  /// Of the global map, as far as it is known here.
  virtual MapCounts counts() const = 0;
};

/// What a system decides on the edge node.
class EdgePolicy {
 public:
  virtual ~EdgePolicy() = default;
  /// Before the run: spawn workers. The run ends when one of them calls EdgeNode::end.
  virtual void start() = 0;
  /// The global map.
  virtual std::shared_ptr<const Map> map() const = 0;
  /// After all workers have ended: what is to stay in the node's folder.
  virtual void leave(const std::filesystem::path&) {}
};

/// A system as the programs know it. Factories run before the start: they open their channels.
struct System {
  std::string name;
  std::vector<ParameterSpec> parameters;
  std::vector<std::string> channels;  ///< none: everything runs on the mobile
  /// Types of its own messages, beside the core's: from 128 on
  /// (docs/how-to/write-a-system-in-cpp.md).
  std::vector<wire::MessageRange> messages;
  std::vector<SensorKind> sensors{SensorKind::kRgbd};
  std::function<OrbOptions(const Parameters&)> orb;
  std::function<TrackerOptions(const Parameters&)> tracker;
  std::function<bool(const Parameters&)> sequential;  ///< frames as fast as they can be tracked
  /// Map file that the mobile node starts in, empty: none; not set: the system never does.
  std::function<std::string(const Parameters&)> prior_map;
  /// Whether the mobile node leaves its map behind as a file; not set: never.
  std::function<bool(const Parameters&)> save_map;
  /// Numbers of octaves that the mobile may change extraction to (MobileNode::use_levels); not set:
  /// those of `orb` for good.
  std::function<std::vector<int>(const Parameters&)> orb_levels;
  /// JPEG quality of the pictures that go to the edge; not set: none does.
  std::function<int(const Parameters&)> jpeg_quality;
  /// Whether features are extracted on the edge, from those pictures; not set: on the mobile.
  std::function<bool(const Parameters&)> extracts_on_edge;
  std::function<std::unique_ptr<MobilePolicy>(MobileNode&, const Parameters&)> mobile;
  std::function<std::unique_ptr<EdgePolicy>(EdgeNode&, const Parameters&)> edge;
};

}  // namespace slambed
