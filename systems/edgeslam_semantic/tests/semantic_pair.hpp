// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>

#include "edgeslam_semantic/tests/semantic_run.hpp"
#include "node/edge_node.hpp"
#include "node/mobile_node.hpp"
#include "run/sim_config.hpp"
#include "runtime/virtual/virtual_network.hpp"

namespace slambed {

/// Returns the test's masks. Where the test gives none, the segmentation fails.
class GivenMasks final : public MaskSource {
 public:
  using MaskOf = std::function<std::optional<FrameMasks>(std::uint64_t frame)>;
  explicit GivenMasks(MaskOf mask_of) : mask_of_(std::move(mask_of)) {}
  Segmentation masks(std::uint64_t frame, std::span<const std::uint8_t>, double) override {
    return {mask_of_(frame), "the segmenter was lost"};
  }

 private:
  MaskOf mask_of_;
};

/// When one edge process dies and another replaces it. Messages in flight to the mobile are lost;
/// messages from the mobile wait for the new process.
struct EdgeLife {
  RunTime dies = kNever, comes_back = kNever;
  int torn_upload = 0;  ///< which message of channel `frame` is truncated, from 1; 0: none

  bool away(RunTime now) const { return now >= dies && now < comes_back; }
  std::uint64_t session(RunTime now) const { return now >= comes_back ? 2 : 1; }
};

/// A node's view of the link while edges die and restart. `session` is 0 for the mobile, which runs
/// all the time, and 1 or 2 for an edge process.
class MortalNetwork final : public Network {
 public:
  /// The link's channels by name; both edge processes share them.
  using Opened = std::map<std::string, Channel*>;

  MortalNetwork(Network& below, Opened& opened, Runtime& runtime, EdgeLife life,
                std::uint64_t session)
      : below_(below), opened_(opened), runtime_(runtime), life_(life), own_(session) {}

  Channel& open(const ChannelOptions& options) override {
    Channel*& below = opened_[options.name];
    if (!below) below = &below_.open(options);
    return *channels_.emplace_back(std::make_unique<MortalChannel>(*this, *below));
  }
  PeerState peer() const override {
    PeerState state = below_.peer();
    if (own_ != 0 || !state.session) return state;
    const RunTime now = runtime_.now();
    return {.connected = state.connected && !life_.away(now), .session = life_.session(now)};
  }
  Signal& peer_signal() override { return *changes_; }

 private:
  class MortalChannel final : public Channel {
   public:
    MortalChannel(const MortalNetwork& network, Channel& below)
        : network_(network), below_(below) {}
    const ChannelOptions& options() const override { return below_.options(); }
    std::uint64_t send(std::uint8_t type, Bytes payload) override {
      return network_.alive() ? below_.send(type, std::move(payload)) : 0;
    }
    void hold(bool held) override { below_.hold(held); }
    std::optional<Message> try_receive() override {
      auto message = network_.take(below_);
      if (message && network_.own_ != 0 && options().name == "frame" &&
          ++received_ == network_.life_.torn_upload)
        message->payload.resize(message->payload.size() / 2);
      return message;
    }
    Signal& signal() override { return below_.signal(); }
    PathStats path() const override { return below_.path(); }

   private:
    const MortalNetwork& network_;
    Channel& below_;
    int received_ = 0;
  };

  bool alive() const {
    const RunTime now = runtime_.now();
    return own_ == 0 || (!life_.away(now) && life_.session(now) == own_);
  }
  std::optional<Message> take(Channel& below) const {
    if (!alive()) return std::nullopt;
    auto message = below.try_receive();
    // Drop answers of the dead edge that were still on the link.
    while (own_ == 0 && message && life_.away(message->received)) message = below.try_receive();
    if (message && own_ == 0) message->session = life_.session(message->received);
    return message;
  }

  Network& below_;
  Opened& opened_;
  Runtime& runtime_;
  EdgeLife life_;
  std::uint64_t own_;
  std::unique_ptr<Signal> changes_ = runtime_.make_signal();
  std::vector<std::unique_ptr<MortalChannel>> channels_;
};

/// Runs both nodes on SemanticRun's pictures with faults that a scenario file cannot express: a
/// failing segmentation, and an edge that is killed and restarted.
class SemanticPair : public SemanticRun {
 protected:
  /// Number of keyframes in the mobile's map when the new edge started.
  std::uint64_t kept_keyframes = 0;

  Played play_pair(const nlohmann::json& chosen, GivenMasks::MaskOf mask_of, EdgeLife life = {}) {
    write_scenario(chosen);
    const SimConfig config = read_sim_config(folder.path() / "sim.json");
    const System system = edgeslam_semantic_system();
    const Parameters parameters(chosen, system.parameters, "params.");
    const PreparedSequence pictures(sequence);
    const Playlist playlist(pictures.timestamps_ns(), pictures.fps(), {});
    Simulator simulator;
    const wire::MessageNames names(system.messages);
    EventLog mobile_log(folder.path() / "mobile.jsonl", NodeRole::kMobile, EventLog::Open::kAnew,
                        names);
    EventLog edge_log(folder.path() / "edge.jsonl", NodeRole::kEdge, EventLog::Open::kAnew, names);
    for (EventLog* log : {&mobile_log, &edge_log}) {
      log->set_clock([&simulator] { return simulator.now(); });
      log->start(Duration::zero(), [] {});
    }
    VirtualRuntime mobile_runtime(simulator, config.mobile, 1, mobile_log);
    VirtualRuntime first_runtime(simulator, *config.edge, 2, edge_log);
    VirtualRuntime second_runtime(simulator, *config.edge, 3, edge_log);
    VirtualLink link(simulator, config.link.up, config.link.down, 1);
    const OrbOptions orb = system.orb(parameters);
    const wire::SensorInfo info{.camera = pictures.camera(),
                                .close_depth_m = static_cast<float>(pictures.close_depth_m()),
                                .levels = orb.levels,
                                .scale_factor = orb.scale_factor,
                                .played_fps = playlist.played_fps()};
    PeerInfo peer;
    peer.set(info);
    GivenMasks masks(std::move(mask_of));
    EncodingSource images(pictures, parameters.integer("jpeg_quality"));
    ExtractingSource features(pictures, info.make_sensor(), orb);
    RealtimeFeed feed(mobile_runtime, playlist, mobile_log);
    MortalNetwork::Opened below_mobile, below_edges;
    MortalNetwork mobile_network(link.mobile_side(mobile_log), below_mobile, mobile_runtime, life,
                                 0);
    Network& edge_side = link.edge_side(edge_log);
    MortalNetwork first_network(edge_side, below_edges, first_runtime, life, 1);
    MortalNetwork second_network(edge_side, below_edges, second_runtime, life, 2);
    DecodedPictures first_pictures([&] { return info.make_sensor(); }, orb);
    DecodedPictures second_pictures([&] { return info.make_sensor(); }, orb);
    const auto parts = [&](VirtualRuntime& runtime, Network& network, DecodedPictures& decoded) {
      return EdgeParts{runtime, network, edge_log, peer, &decoded, &masks};
    };
    EdgeNode first(parts(first_runtime, first_network, first_pictures), system, parameters);
    EdgeNode second(parts(second_runtime, second_network, second_pictures), system, parameters);
    MobileNode mobile({.runtime = mobile_runtime,
                       .network = &mobile_network,
                       .log = mobile_log,
                       .features = features,
                       .feed = feed,
                       .sequence = &pictures,
                       .sensor = pictures.sensor(),
                       .played_fps = playlist.played_fps(),
                       .timestamps_ns = pictures.timestamps_ns(),
                       .time_origin_ns = pictures.time_origin_ns(),
                       .images = &images},
                      system, parameters);
    mobile.start();
    first.start();
    if (life.dies != kNever) {
      simulator.at(life.dies, [&] { first_runtime.stop(); });
      simulator.at(life.comes_back, [&] { second.start(); });
      simulator.at(life.comes_back,
                   [&] { kept_keyframes = count(*mobile.tracker().map()).keyframes; });
      for (const RunTime change : {life.dies, life.comes_back})
        simulator.at(change, [&] { mobile_network.peer_signal().notify(); });
    }
    simulator.run();
    for (VirtualRuntime* runtime : {&mobile_runtime, &first_runtime, &second_runtime})
      runtime->join();
    mobile.write_trajectories(folder.path());
    for (EventLog* log : {&mobile_log, &edge_log}) log->flush();
    Played played;
    for (const char* name : {"mobile.jsonl", "edge.jsonl"})
      played.add(testing::read_text(folder.path() / name));
    played.trajectory = testing::read_text(folder.path() / "trajectory.txt");
    return played;
  }
};

}  // namespace slambed
