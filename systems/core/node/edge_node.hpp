// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <mutex>
#include <optional>

#include "node/event_log.hpp"
#include "node/policy.hpp"
#include "sequence/mask_source.hpp"
#include "sequence/picture_features.hpp"
#include "wire/hello.hpp"

namespace slambed {

/// What the greeting says about the peer. Thread-safe.
class PeerInfo {
 public:
  static constexpr double kFpsUntilKnown = 30;

  void set(const wire::SensorInfo& sensor) {
    std::lock_guard lock(mutex_);
    if (!sensor_) {
      sensor_ = sensor.make_sensor();
      info_ = sensor;
    }
  }
  std::optional<wire::SensorInfo> info() const {
    std::lock_guard lock(mutex_);
    return info_;
  }
  /// Null until a mobile has connected, then constant.
  std::shared_ptr<const Sensor> sensor() const {
    std::lock_guard lock(mutex_);
    return sensor_;
  }
  double played_fps() const {
    std::lock_guard lock(mutex_);
    return info_ ? info_->played_fps : kFpsUntilKnown;
  }

 private:
  mutable std::mutex mutex_;
  std::shared_ptr<const Sensor> sensor_;
  std::optional<wire::SensorInfo> info_;
};

/// Makes this node's greeting; checking the peer's greeting stores its sensor in peer.
Greeting make_greeting(NodeRole role, const std::string& run_key, const std::string& system,
                       std::optional<wire::SensorInfo> sensor, PeerInfo& peer);

struct EdgeParts {
  Runtime& runtime;
  Network& network;
  EventLog& log;
  const PeerInfo& peer;
  PictureFeatures* pictures = nullptr;  ///< null: no pictures arrive
  MaskSource* masks = nullptr;          ///< null: pictures are not segmented
};

/// The edge node runs the system's policy and lets it end the run.
class EdgeNode {
 public:
  EdgeNode(EdgeParts parts, const System& system, const Parameters& parameters);
  ~EdgeNode();

  void start();
  std::shared_ptr<const Map> map() const { return policy_->map(); }
  MapCounts counts() const { return count(*map()); }
  /// Why the run ended ("bye", "peer_lost"); empty while it runs or if it was stopped from outside.
  std::string end_reason() const;
  /// Call it after the runtime has joined.
  void leave(const std::filesystem::path& folder) { policy_->leave(folder); }

  // What a policy may call.
  Runtime& runtime() { return parts_.runtime; }
  Network& network() { return parts_.network; }
  EventLog& log() { return parts_.log; }
  const PeerInfo& peer() const { return parts_.peer; }
  /// For systems that extract on the edge.
  PictureFeatures& pictures() { return *parts_.pictures; }
  MaskSource* masks() { return parts_.masks; }
  void end(const std::string& reason);

 private:
  EdgeParts parts_;
  std::unique_ptr<EdgePolicy> policy_;
  mutable std::mutex mutex_;
  std::string end_reason_;
};

}  // namespace slambed
