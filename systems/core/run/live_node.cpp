// SPDX-License-Identifier: Apache-2.0
#include "run/live_node.hpp"

#include <memory>
#include <optional>

#include "base/error.hpp"
#include "node/edge_node.hpp"
#include "run/built_nodes.hpp"
#include "run/segmenter_client.hpp"
#include "runtime/keyed_random.hpp"
#include "runtime/live/background_load.hpp"
#include "runtime/live/live_runtime.hpp"
#include "runtime/live/stop_signals.hpp"
#include "runtime/live/tcp_network.hpp"

namespace slambed {
namespace {

namespace fs = std::filesystem;

constexpr Duration kLinger = std::chrono::seconds(2);

/// A node of either role. Members are declared so that they can be destroyed in reverse order.
class LiveNode {
 public:
  LiveNode(const LiveNodeOptions& options, std::span<const System> systems)
      : role_(options.role),
        config_(read_run_config(options.config)),
        system_(find_system(systems, config_.system)),
        parameters_(config_.params, system_.parameters, options.config.string() + ": params."),
        restarted_(succeeds_a_dead_edge(config_.output, role_)),
        folder_(prepare_node_folder(config_.output, role_)),
        log_(folder_ / "events.jsonl", role_,
             restarted_ ? EventLog::Open::kAppend : EventLog::Open::kAnew,
             wire::MessageNames(system_.messages)),
        runtime_(log_, pace()) {
    log_.set_clock([this] { return runtime_.now(); });
    if (restarted_) log_.write(JsonLine("node_restarted"));
    check_network(system_, config_, options.config.string());
    if (role_ == NodeRole::kEdge && system_.channels.empty()) {
      throw bad_input("--role edge: " + system_.name + " runs on the mobile node alone");
    }
  }

  void run(const LiveNodeOptions& options) {
    if (role_ == NodeRole::kMobile) {
      open_sequence(options.verify);
    } else {
      open_network(std::nullopt);
      if (system_.extracts_on_edge && system_.extracts_on_edge(parameters_))
        pictures_.emplace([this] { return peer_.sensor(); }, system_.orb(parameters_));
      if (config_.segmenter) open_segmenter(*config_.segmenter);
      edge_.emplace(EdgeParts{runtime_, *network_, log_, peer_, pictures_ ? &*pictures_ : nullptr,
                              segmenter_ ? &*segmenter_ : nullptr},
                    system_, parameters_);
    }
    signals_.watch([this] { runtime_.stop(); });
    if (network_) {
      network_->start();
      if (role_ == NodeRole::kMobile) await_peer();
    }
    write_by_rename(folder_ / "ready.json", {{"role", role_name(role_)}});
    const auto t0 = await_start(config_.output, from_seconds(config_.connect_timeout_s),
                                [this] { return runtime_.stopping(); });
    if (t0) {
      log_.start(*t0, [&] { runtime_.set_origin(*t0); });
      live();
    }
    finish();
  }

  ~LiveNode() { signals_.unwatch(); }

 private:
  /// The seed is that of the virtual engine, so both draw the same jitter.
  std::optional<PaceOptions> pace() const {
    const auto found = config_.pace.find(role_);
    if (found == config_.pace.end()) return {};
    return PaceOptions{.device = found->second.device,
                       .share = found->second.share,
                       .seed = mix(config_.seed) ^ hash_name(role_name(role_))};
  }

  void open_sequence(bool verify) {
    played_.emplace(system_, parameters_, config_);
    if (verify) played_->sequence.verify_all();
    features_.emplace(played_->sequence, played_->sensor.make_sensor(), played_->orb);
    if (system_.jpeg_quality) images_.emplace(played_->sequence, system_.jpeg_quality(parameters_));
    if (config_.network) open_network(played_->sensor);
    mobile_.emplace(system_, parameters_, config_, *played_,
                    MobileSurroundings{.runtime = runtime_,
                                       .network = network_ ? &*network_ : nullptr,
                                       .log = log_,
                                       .features = *features_,
                                       .images = images_ ? &*images_ : nullptr});
  }

  void open_network(const std::optional<wire::SensorInfo>& sensor) {
    network_.emplace(runtime_, log_,
                     TcpNetworkOptions{.listens = role_ == NodeRole::kEdge,
                                       .address = config_.network->edge_address,
                                       .ports = config_.network->ports},
                     make_greeting(role_, config_.run_key, system_.name, sensor, peer_));
  }

  void open_segmenter(const SegmenterConfig& config) {
    segmenter_.emplace(
        SegmenterOptions{.socket = config.socket, .time_limit = from_seconds(config.time_limit_s)},
        [this] { return peer_.sensor(); });
  }

  void await_peer() {
    if (network_->wait_connected(from_seconds(config_.connect_timeout_s)) || runtime_.stopping()) {
      return;
    }
    throw Error(ExitCode::kPeer, "no edge node at " + config_.network->edge_address + " within " +
                                     std::to_string(static_cast<int>(config_.connect_timeout_s)) +
                                     " s; start it first or raise connect_timeout_s");
  }

  void live() {
    try {
      spawn_log_writer(runtime_, log_);
      if (const auto found = config_.pace.find(role_); found != config_.pace.end())
        spawn_background_load(runtime_, found->second.device.background, found->second.share);
      if (mobile_) mobile_->start();
      if (edge_) edge_->start();
      runtime_.join();
    } catch (const std::exception& error) {
      // Keep what was recorded, whatever went wrong.
      runtime_.stop();
      runtime_.join();
      log_.warning(error.what());
      log_.flush();
      throw;
    }
  }

  void finish() {
    if (network_) network_->close(kLinger);
    NodeEnd end = mobile_ ? mobile_->leave(folder_) : leave(*edge_, folder_);
    end.messages_refused = log_.refused();
    log_.flush();
    write_node_end(folder_, end);
  }

  StopSignals signals_;  ///< first, so that all later threads inherit the blocked signals
  NodeRole role_;
  RunConfig config_;
  const System& system_;
  Parameters parameters_;
  bool restarted_;
  fs::path folder_;
  EventLog log_;
  LiveRuntime runtime_;
  PeerInfo peer_;
  std::optional<PlayedSequence> played_;
  std::optional<ExtractingSource> features_;
  std::optional<EncodingSource> images_;
  std::optional<DecodedPictures> pictures_;
  std::optional<SegmenterClient> segmenter_;
  std::optional<TcpNetwork> network_;
  std::optional<BuiltMobile> mobile_;
  std::optional<EdgeNode> edge_;
};

}  // namespace

void run_live_node(const LiveNodeOptions& options, std::span<const System> systems) {
  LiveNode node(options, systems);
  node.run(options);
}

}  // namespace slambed
