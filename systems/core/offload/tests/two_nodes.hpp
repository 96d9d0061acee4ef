// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "node/tests/virtual_pair.hpp"
#include "offload/tests/turning_pair.hpp"
#include "wire/messages.hpp"

namespace slambed::testing {

/// A mobile and an edge without policies, 10 ms apart, in virtual time. Only what a test spawns on
/// them runs. Every stage takes 2 ms.
class TwoNodes {
 public:
  static constexpr Duration kOneWay = std::chrono::milliseconds(10);

  TwoNodes() {
    for (EventLog* log : {&mobile_log, &edge_log}) {
      log->set_clock([this] { return simulator.now(); });
      log->start(Duration::zero(), [] {});
    }
    const auto sensor = source.sensor();
    peer.set({.camera = sensor->camera, .close_depth_m = sensor->close_depth_m, .played_fps = 10});
  }

  /// Returns the two ends of a channel: mobile, edge.
  std::pair<Channel&, Channel&> open(const ChannelOptions& options) {
    return {mobile.network().open(options), edge.network().open(options)};
  }
  void on_mobile(std::function<void(Worker&)> body) { spawn(mobile_runtime, std::move(body)); }
  void on_edge(std::function<void(Worker&)> body) { spawn(edge_runtime, std::move(body)); }
  /// Runs both nodes until this time. Call it once.
  void run_until(RunTime end) {
    for (VirtualRuntime* runtime : {&mobile_runtime, &edge_runtime}) {
      runtime->spawn("end", [=](Worker& worker) {
        worker.sleep_until(end);
        runtime->stop();
      });
    }
    simulator.run();
    mobile_runtime.join();
    edge_runtime.join();
  }
  /// Call it after the run.
  std::vector<nlohmann::json> events(const std::string& type) {
    std::vector<nlohmann::json> found;
    for (const char* name : {"mobile.jsonl", "edge.jsonl"}) {
      mobile_log.flush();
      edge_log.flush();
      std::istringstream lines(read_text(folder.path() / name));
      for (std::string line; std::getline(lines, line);) {
        auto event = nlohmann::json::parse(line);
        if (event["type"] == type) found.push_back(std::move(event));
      }
    }
    return found;
  }

  TemporaryFolder folder;
  Simulator simulator;
  EventLog mobile_log{folder.path() / "mobile.jsonl", NodeRole::kMobile};
  EventLog edge_log{folder.path() / "edge.jsonl", NodeRole::kEdge};
  VirtualRuntime mobile_runtime{simulator, uniform_device(2000), 1, mobile_log};
  VirtualRuntime edge_runtime{simulator, uniform_device(2000), 2, edge_log};
  VirtualLink link{simulator, path(), path(), 1};
  SceneSource source{turn, false};
  PeerInfo peer;
  Playlist playlist{std::vector<std::int64_t>{0}, 10, {}};
  RealtimeFeed feed{mobile_runtime, playlist, mobile_log};
  EdgeNode edge{{edge_runtime, link.edge_side(edge_log), edge_log, peer}, nobody(), none()};
  MobileNode mobile{{.runtime = mobile_runtime,
                     .network = &link.mobile_side(mobile_log),
                     .log = mobile_log,
                     .features = source,
                     .feed = feed,
                     .timestamps_ns = {}},
                    nobody(),
                    none()};

 private:
  static link::DirectionOptions path() {
    link::DirectionOptions options;
    options.delays_ns = {kOneWay.count()};
    return options;
  }
  static System nobody() {
    System system;
    system.tracker = [](const Parameters&) { return TrackerOptions(); };
    system.mobile = [](MobileNode&, const Parameters&) { return nullptr; };
    system.edge = [](EdgeNode&, const Parameters&) { return nullptr; };
    return system;
  }
  static Parameters none() { return Parameters(nlohmann::json::object(), {}, "params."); }
  void spawn(VirtualRuntime& runtime, std::function<void(Worker&)> body) {
    runtime.spawn("test " + std::to_string(++spawned_), std::move(body));
  }
  int spawned_ = 0;
};

/// Keyframes of a turn as a mobile sends them, the first one whole, and the map that they form.
struct SentTurn {
  explicit SentTurn(std::size_t keyframes) {
    SyntheticScene scene;
    Tracker tracker({}, map, IdSpace::kTracker);
    for (int frame = 0; messages.size() < keyframes; ++frame) {
      tracker.track(static_cast<std::uint64_t>(frame), 0.1 * frame, turn(scene, frame));
      if (!tracker.wants_keyframe({})) continue;
      wire::KeyFrameMessage message;
      message.delta = tracker.create_keyframe();
      message.keyframe = message.delta.keyframes.back().id;
      message.first = message.whole = messages.empty();
      messages.push_back(std::move(message));
    }
  }
  KeyFrameId id(std::size_t place) const { return messages[place].keyframe; }

  std::shared_ptr<Map> map = std::make_shared<Map>();
  std::vector<wire::KeyFrameMessage> messages;
};

}  // namespace slambed::testing
