// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <nlohmann/json.hpp>

#include "base/tests/temporary_folder.hpp"
#include "map/map_snapshot.hpp"
#include "node/edge_node.hpp"
#include "node/mobile_node.hpp"
#include "runtime/virtual/virtual_network.hpp"
#include "slam/tests/synthetic_scene.hpp"
#include "wire/messages.hpp"

namespace slambed::testing {

/// Features of a synthetic scene instead of images.
class SceneSource final : public FeatureSource {
 public:
  using Look = std::function<std::shared_ptr<const FeatureSet>(SyntheticScene&, int frame)>;
  SceneSource(Look look, bool single_camera)
      : scene_(kPoints, 1, single_camera), look_(std::move(look)) {}
  std::shared_ptr<const FeatureSet> features(std::uint64_t frame) override {
    return look_(scene_, static_cast<int>(frame));
  }
  std::shared_ptr<const Sensor> sensor() const override { return scene_.sensor(); }

 private:
  static constexpr int kPoints = 5000;
  SyntheticScene scene_;
  Look look_;
};

/// A device on which every stage takes the same time.
inline DeviceModel uniform_device(double stage_us) {
  DeviceModel model;
  model.cores = 2;
  for (const char* stage : {"extract",
                            "track",
                            "create_keyframe",
                            "serialize",
                            "parse",
                            "insert",
                            "cull_points",
                            "triangulate",
                            "fuse",
                            "bundle",
                            "cull_keyframes",
                            "prepare_update",
                            "apply_update",
                            "insert_keyframes",
                            "update_reference",
                            "update_last_frame",
                            "clean_map",
                            "relocalize",
                            "serialize_text",
                            "parse_text",
                            "loop_detect",
                            "loop_close",
                            "global_bundle"}) {
    model.stages[stage] = {.a_us = stage_us, .b_us = 0, .c_us = 0, .jitter = 0};
  }
  return model;
}

/// A channel whose messages pass through functions of the test.
class TappedChannel final : public Channel {
 public:
  using Take = std::function<std::optional<Message>(Channel& below)>;
  using Sent = std::function<void(const Bytes&)>;
  TappedChannel(Channel& below, Take take, Sent sent)
      : below_(below), take_(std::move(take)), sent_(std::move(sent)) {}
  const ChannelOptions& options() const override { return below_.options(); }
  std::uint64_t send(std::uint8_t type, Bytes payload) override {
    sent_(payload);
    return below_.send(type, std::move(payload));
  }
  void hold(bool held) override { below_.hold(held); }
  std::optional<Message> try_receive() override { return take_(below_); }
  Signal& signal() override { return below_.signal(); }
  PathStats path() const override { return below_.path(); }

 private:
  Channel& below_;
  Take take_;
  Sent sent_;
};

/// A network on which one channel loses its first `lost` messages.
class LosingNetwork final : public Network {
 public:
  LosingNetwork(Network& below, std::string channel, std::uint64_t lost)
      : below_(below), channel_(std::move(channel)), lost_(lost) {}
  Channel& open(const ChannelOptions& options) override {
    Channel& opened = below_.open(options);
    if (options.name != channel_) return opened;
    losing_ = std::make_unique<TappedChannel>(
        opened,
        [this](Channel& below) {
          auto message = below.try_receive();
          while (message && message->sequence <= lost_) message = below.try_receive();
          return message;
        },
        [](const Bytes&) {});
    return *losing_;
  }
  PeerState peer() const override { return below_.peer(); }
  Signal& peer_signal() override { return below_.peer_signal(); }

 private:
  Network& below_;
  std::string channel_;
  std::uint64_t lost_;
  std::unique_ptr<TappedChannel> losing_;
};

/// A network on which the test may change one channel's messages, or drop them by returning false.
class AlteringNetwork final : public Network {
 public:
  using Alter = std::function<bool(Message&)>;
  AlteringNetwork(Network& below, std::string channel, Alter alter, bool twice = false)
      : below_(below), channel_(std::move(channel)), alter_(std::move(alter)), twice_(twice) {}
  Channel& open(const ChannelOptions& options) override {
    Channel& opened = below_.open(options);
    if (options.name != channel_ || (!alter_ && !twice_)) return opened;
    altering_ = std::make_unique<TappedChannel>(
        opened,
        [this](Channel& below) {
          if (again_) return std::exchange(again_, std::nullopt);
          auto message = below.try_receive();
          while (message && alter_ && !alter_(*message)) message = below.try_receive();
          if (twice_) again_ = message;
          return message;
        },
        [](const Bytes&) {});
    return *altering_;
  }
  PeerState peer() const override { return below_.peer(); }
  Signal& peer_signal() override { return below_.peer_signal(); }

 private:
  Network& below_;
  std::string channel_;
  Alter alter_;
  bool twice_;                    ///< each message is delivered twice
  std::optional<Message> again_;  ///< the second copy, still to be delivered
  std::unique_ptr<TappedChannel> altering_;
};

/// Simulates a restart of the edge for the mobile: at `when` the session changes, and the new edge
/// asks for a keyframe, as one was in flight to the old edge. The real edge keeps running.
class RestartingNetwork final : public Network {
 public:
  RestartingNetwork(Network& below, Runtime& runtime, RunTime when)
      : below_(below), runtime_(runtime), when_(when) {}
  Channel& open(const ChannelOptions& options) override {
    const bool keyframes = options.name == "keyframe";
    channels_.push_back(std::make_unique<TappedChannel>(
        below_.open(options), [this, keyframes](Channel& below) { return take(below, keyframes); },
        [this, keyframes](const Bytes& sent) {
          if (keyframes) keyframes_.push_back(sent);
        }));
    return *channels_.back();
  }
  PeerState peer() const override {
    PeerState state = below_.peer();
    if (restarted()) ++state.session;
    return state;
  }
  Signal& peer_signal() override { return below_.peer_signal(); }
  /// Payloads of all messages sent on the channel "keyframe".
  const std::vector<Bytes>& keyframes() const { return keyframes_; }

 private:
  bool restarted() const { return runtime_.now() >= when_; }
  std::optional<Message> take(Channel& below, bool keyframes) {
    if (keyframes && restarted() && !std::exchange(asked_, true)) {
      return Message{.type = wire::type_of(wire::kKeyFrameWanted),
                     .session = below_.peer().session + 1,
                     .payload = {}};
    }
    auto message = below.try_receive();
    if (message && message->received >= when_) ++message->session;
    return message;
  }

  Network& below_;
  Runtime& runtime_;
  RunTime when_;
  bool asked_ = false;
  std::vector<std::unique_ptr<TappedChannel>> channels_;
  std::vector<Bytes> keyframes_;
};

/// One-way delays in ms, equal in both directions: one constant, or one per step.
struct PairLink {
  std::vector<double> one_way_ms = {0.1};
  double step_s = 0.1;
  std::vector<link::Gap> gaps = {};
  std::optional<RttTable> profile_rtt{};  ///< given to the mobile, whatever the real delays are
  std::string lossy_channel = "keyframe";
  std::uint64_t lost = 0;          ///< the first messages on that channel never reach the edge
  std::uint64_t lost_updates = 0;  ///< the first messages on the map channel never reach the mobile
  AlteringNetwork::Alter alter_frames{};  ///< changes what the edge answers on the channel "frame"
  bool frames_twice = false;              ///< each of these answers is delivered twice
  AlteringNetwork::Alter alter_handovers{};  ///< changes what the mobile sends on "handover"
  RunTime edge_restarts = kNever;
  double edge_bundle_us = 2000;  ///< per stage of a global bundle, on a uniform device
  double mbit_per_s = 100;
  bool single_camera = false;  ///< mono
  /// Device models to use instead of the uniform ones.
  std::optional<DeviceModel> mobile_device{}, edge_device{};

  link::DirectionOptions direction() const {
    link::DirectionOptions options;
    options.delays_ns.clear();
    for (const double ms : one_way_ms) options.delays_ns.push_back(std::llround(ms * 1e6));
    options.step_ns = std::llround(step_s * 1e9);
    options.rate = link::RateOptions{.bits_per_s = mbit_per_s * 1e6, .queue_bytes = 10'000'000};
    options.gaps = gaps;
    options.gap_drops = true;
    return options;
  }
};

struct PairResult {
  std::string mobile_text, edge_text;  ///< events.jsonl
  std::string trajectory;
  std::vector<nlohmann::json> mobile, edge;
  std::string end_reason;
  bool finished = false;
  MapCounts mobile_counts, edge_counts;
  MapDelta mobile_map, edge_map;             ///< at the end of the run
  std::vector<Bytes> keyframes;              ///< KEYFRAME messages as they were sent
  std::map<KeyFrameId, SE3> keyframe_poses;  ///< T_cw that the final trajectory uses

  std::vector<nlohmann::json> of(const std::string& type) const {
    std::vector<nlohmann::json> found;
    for (const auto* side : {&mobile, &edge}) {
      for (const auto& event : *side) {
        if (event["type"] == type) found.push_back(event);
      }
    }
    return found;
  }
};

/// Runs mobile and edge of one system in one process in virtual time.
inline PairResult run_pair(const System& system, const nlohmann::json& params, int frames,
                           double fps, const PairLink& path, SceneSource::Look look) {
  TemporaryFolder folder;
  const Parameters parameters(params, system.parameters, "params.");
  std::vector<std::int64_t> times;
  for (int i = 0; i < frames; ++i) times.push_back(std::llround(i * 1e9 / fps));
  const Playlist playlist(times, fps, {});
  PairResult result;
  {
    Simulator simulator;
    const wire::MessageNames names(system.messages);
    EventLog mobile_log(folder.path() / "mobile.jsonl", NodeRole::kMobile, EventLog::Open::kAnew,
                        names);
    EventLog edge_log(folder.path() / "edge.jsonl", NodeRole::kEdge, EventLog::Open::kAnew, names);
    for (EventLog* log : {&mobile_log, &edge_log}) {
      log->set_clock([&simulator] { return simulator.now(); });
      log->start(Duration::zero(), [] {});
    }
    VirtualRuntime mobile_runtime(simulator, path.mobile_device.value_or(uniform_device(2000)), 1,
                                  mobile_log);
    DeviceModel uniform_edge = uniform_device(2000);
    uniform_edge.stages["global_bundle"].a_us = path.edge_bundle_us;
    VirtualRuntime edge_runtime(simulator, path.edge_device.value_or(uniform_edge), 2, edge_log);
    VirtualLink link(simulator, path.direction(), path.direction(), 1);
    SceneSource source(std::move(look), path.single_camera);
    PeerInfo peer;
    const auto sensor = source.sensor();
    peer.set({.camera = sensor->camera,
              .close_depth_m = sensor->close_depth_m,
              .played_fps = playlist.played_fps()});
    RealtimeFeed feed(mobile_runtime, playlist, mobile_log);
    LosingNetwork losing(link.edge_side(edge_log), path.lossy_channel, path.lost);
    AlteringNetwork edge_network(losing, "handover", path.alter_handovers);
    LosingNetwork losing_updates(link.mobile_side(mobile_log), "map", path.lost_updates);
    AlteringNetwork altering_frames(losing_updates, "frame", path.alter_frames, path.frames_twice);
    RestartingNetwork mobile_network(altering_frames, mobile_runtime, path.edge_restarts);
    EdgeNode edge({edge_runtime, edge_network, edge_log, peer}, system, parameters);
    MobileNode mobile({.runtime = mobile_runtime,
                       .network = &mobile_network,
                       .log = mobile_log,
                       .features = source,
                       .feed = feed,
                       .sensor = path.single_camera ? SensorKind::kMono : SensorKind::kRgbd,
                       .played_fps = playlist.played_fps(),
                       .timestamps_ns = times,
                       .time_origin_ns = 0,
                       .profile_rtt = path.profile_rtt},
                      system, parameters);
    mobile.start();
    edge.start();
    simulator.run();
    mobile_runtime.join();
    edge_runtime.join();
    mobile.write_trajectories(folder.path());
    for (const KeyFrameId id : mobile.poses().keyframes())
      result.keyframe_poses[id] = mobile.poses().pose(id).value();
    result.finished = mobile.finished();
    result.end_reason = edge.end_reason();
    result.mobile_counts = mobile.counts();
    result.edge_counts = edge.counts();
    result.mobile_map = mobile.tracker().map()->read(snapshot);
    result.edge_map = edge.map()->read(snapshot);
    result.keyframes = mobile_network.keyframes();
  }
  const auto parse = [](const std::string& text) {
    std::vector<nlohmann::json> events;
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);)
      events.push_back(nlohmann::json::parse(line));
    return events;
  };
  result.mobile_text = read_text(folder.path() / "mobile.jsonl");
  result.edge_text = read_text(folder.path() / "edge.jsonl");
  result.trajectory = read_text(folder.path() / "trajectory.txt");
  result.mobile = parse(result.mobile_text);
  result.edge = parse(result.edge_text);
  return result;
}

}  // namespace slambed::testing
