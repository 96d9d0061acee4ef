// SPDX-License-Identifier: Apache-2.0
#include "run/virtual_run.hpp"

#include <memory>
#include <optional>
#include <string>

#include "base/error.hpp"
#include "node/edge_node.hpp"
#include "node/map_keeping.hpp"
#include "node/mobile_node.hpp"
#include "run/built_nodes.hpp"
#include "run/node_files.hpp"
#include "run/sim_config.hpp"
#include "run/virtual_sampler.hpp"
#include "runtime/keyed_random.hpp"
#include "runtime/virtual/virtual_network.hpp"
#include "sequence/feature_cache.hpp"
#include "sequence/mask_cache.hpp"

namespace slambed {
namespace {

namespace fs = std::filesystem;

/// The members that both nodes have. Their order matters for destruction.
struct VirtualNode {
  VirtualNode(Simulator& simulator, const SimConfig& config, const System& system,
              NodeRole node_role, DeviceModel device)
      : role(node_role),
        folder(prepare_node_folder(config.run.output, node_role)),
        log(folder / "events.jsonl", node_role, EventLog::Open::kAnew,
            wire::MessageNames(system.messages)),
        runtime(simulator, std::move(device),
                mix(config.run.seed) ^ hash_name(role_name(node_role)), log) {
    log.set_clock([&simulator] { return simulator.now(); });
    log.start(Duration::zero(), [] {});
  }

  void end(NodeEnd how) {
    log.flush();
    how.role = role;
    how.messages_refused = log.refused();
    write_node_end(folder, how);
  }

  NodeRole role;
  fs::path folder;
  EventLog log;
  VirtualRuntime runtime;
};

class VirtualRun {
 public:
  VirtualRun(const fs::path& path, std::span<const System> systems)
      : config_(read_sim_config(path)),
        system_(find_system(systems, config_.run.system)),
        parameters_(config_.run.params, system_.parameters, path.string() + ": params."),
        played_(system_, parameters_, config_.run),
        link_(simulator_, config_.link.up, config_.link.down, config_.run.seed),
        mobile_(simulator_, config_, system_, NodeRole::kMobile, config_.mobile) {
    check_network(system_, config_.run, path.string());
    if (config_.edge) edge_.emplace(simulator_, config_, system_, NodeRole::kEdge, *config_.edge);
    make_nodes();
  }

  void run() {
    std::vector<SampledNode> sampled{{"mobile", &mobile_.runtime}};
    if (edge_) sampled.push_back({"edge", &edge_->runtime});
    VirtualSampler sampler(simulator_, std::move(sampled), config_.run.output / "samples.jsonl");
    if (edge_) {
      mobile_.runtime.on_failure([this] { edge_->runtime.stop(); });
      edge_->runtime.on_failure([this] { mobile_.runtime.stop(); });
    }
    for (const auto& [begin, end] : config_.edge_frozen) {
      for (const bool frozen : {true, false}) {
        simulator_.at(frozen ? begin : end, [this, frozen] {
          edge_->runtime.freeze(frozen);
          link_.freeze_edge(frozen);
        });
      }
    }
    if (config_.limit) simulator_.at_background(*config_.limit, [this] { stop_at_limit(); });
    mobile_node_->start();
    if (edge_node_) edge_node_->start();
    simulator_.run();
    sampler.finish();
    mobile_.runtime.join();
    if (edge_) edge_->runtime.join();
    finish();
    if (limit_reached_) throw Error(ExitCode::kPeer, limit_text());
  }

 private:
  void make_nodes() {
    make_pictures();
    // Both ends of every channel must be open before the first message.
    if (edge_) {
      peer_.set(played_.sensor);
      edge_node_.emplace(EdgeParts{edge_->runtime, link_.edge_side(edge_->log), edge_->log, peer_,
                                   pictures_.get(), masks_ ? &*masks_ : nullptr},
                         system_, parameters_);
    }
    mobile_node_.emplace(
        system_, parameters_, config_.run, played_,
        MobileSurroundings{.runtime = mobile_.runtime,
                           .network = edge_ ? &link_.mobile_side(mobile_.log) : nullptr,
                           .log = mobile_.log,
                           .features = *features_,
                           .images = images_.get()});
  }

  /// Makes the sources of features and, for systems that send images, of images and masks.
  void make_pictures() {
    const PreparedSequence& sequence = played_.sequence;
    const OrbOptions& orb = played_.orb;
    const auto sensor = played_.sensor.make_sensor();
    if (system_.jpeg_quality) {
      const int quality = system_.jpeg_quality(parameters_);
      if (config_.images) {
        images_ = std::make_unique<ImageCache>(config_.images->path, config_.images->key, sequence,
                                               quality);
      } else {
        images_ = std::make_unique<EncodingSource>(sequence, quality);
      }
      if (!config_.masks.empty()) masks_.emplace(sequence.camera().width, sequence.camera().height);
      for (const auto& [threshold, cache] : config_.masks)
        masks_->add(threshold, cache.path, cache.key, sequence.frames());
    }
    const bool on_edge = system_.extracts_on_edge && system_.extracts_on_edge(parameters_);
    if (on_edge) {
      features_ = std::make_unique<JpegFeatureSource>(*images_, sensor, orb);
    } else {
      features_ = std::make_unique<ExtractingSource>(sequence, sensor, orb);
    }
    if (config_.features) features_ = cached(orb);
    if (!on_edge) return;
    if (config_.features) {
      pictures_ = std::make_unique<KnownPictures>(*features_);
    } else {
      pictures_ = std::make_unique<DecodedPictures>([sensor] { return sensor; }, orb);
    }
  }

  /// Opens a cache for each number of octaves. The one of `orb` is made last, because the harness
  /// takes its file as the sign that all exist.
  std::unique_ptr<FeatureSource> cached(const OrbOptions& orb) {
    const SimConfig::Cache& file = *config_.features;
    std::map<int, std::unique_ptr<FeatureSource>> by_levels;
    const auto others = system_.orb_levels ? system_.orb_levels(parameters_) : std::vector<int>();
    const auto open = [&](int levels, const std::filesystem::path& path, const std::string& key) {
      features_->use_levels(levels);
      by_levels[levels] =
          std::make_unique<FeatureCache>(path, key, played_.sequence.frames(), *features_);
    };
    for (const int levels : others) {
      if (levels == orb.levels || by_levels.contains(levels)) continue;
      const std::string name = std::to_string(levels);
      auto path = file.path;
      path.replace_filename(path.stem().string() + "-" + name + path.extension().string());
      open(levels, path, file.key + " octaves " + name);
    }
    open(orb.levels, file.path, file.key);
    if (by_levels.size() == 1) return std::move(by_levels.begin()->second);
    return std::make_unique<LeveledFeatures>(std::move(by_levels), orb.levels);
  }

  /// Ends both nodes, so that they still write their files.
  void stop_at_limit() {
    limit_reached_ = true;
    mobile_.runtime.stop();
    if (edge_) edge_->runtime.stop();
  }

  std::string limit_text() const {
    const std::string limit = std::to_string(static_cast<long long>(to_seconds(*config_.limit)));
    const std::string offered = std::to_string(mobile_node_->offered());
    return "stopped at the limit of " + limit + " s of virtual time, after " + offered + " of " +
           std::to_string(played_.playlist.frames().size()) + " frames" +
           (edge_ ? "; events.jsonl shows when the nodes were connected" : "");
  }

  void finish() {
    mobile_.end(mobile_node_->leave(mobile_.folder));
    if (edge_) edge_->end(leave(*edge_node_, edge_->folder));
  }

  SimConfig config_;
  const System& system_;
  Parameters parameters_;
  PlayedSequence played_;
  Simulator simulator_;
  VirtualLink link_;
  VirtualNode mobile_;
  std::optional<VirtualNode> edge_;
  PeerInfo peer_;
  std::unique_ptr<ImageSource> images_;
  std::optional<MaskCache> masks_;
  std::unique_ptr<FeatureSource> features_;
  std::unique_ptr<PictureFeatures> pictures_;
  std::optional<EdgeNode> edge_node_;
  std::optional<BuiltMobile> mobile_node_;
  bool limit_reached_ = false;
};

}  // namespace

void run_virtually(const fs::path& sim_config, std::span<const System> systems) {
  VirtualRun(sim_config, systems).run();
}

}  // namespace slambed
