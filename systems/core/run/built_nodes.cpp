// SPDX-License-Identifier: Apache-2.0
#include "run/built_nodes.hpp"

namespace slambed {
namespace {

std::unique_ptr<FrameFeed> make_feed(const System& system, const Parameters& parameters,
                                     PlaybackMode mode, const PlayedSequence& played,
                                     const MobileSurroundings& around) {
  if (mode == PlaybackMode::kRealtime)
    return std::make_unique<RealtimeFeed>(around.runtime, played.playlist, around.log);
  return std::make_unique<EveryFrameFeed>(played.playlist, !system.sequential(parameters));
}

}  // namespace

PlayedSequence::PlayedSequence(const System& system, const Parameters& parameters,
                               const RunConfig& config)
    : sequence(config.sequence),
      playlist(sequence.timestamps_ns(), sequence.fps(), config.playback),
      orb(system.orb(parameters)),
      sensor{.camera = sequence.camera(),
             .close_depth_m = static_cast<float>(sequence.close_depth_m()),
             .levels = orb.levels,
             .scale_factor = orb.scale_factor,
             .played_fps = playlist.played_fps()} {
  check_sensor(system, sequence);
  check_octaves(system, parameters);
}

BuiltMobile::BuiltMobile(const System& system, const Parameters& parameters,
                         const RunConfig& config, const PlayedSequence& played,
                         const MobileSurroundings& around)
    : feed_(make_feed(system, parameters, config.playback.mode, played, around)),
      maps_(system, parameters, played.sequence, played.playlist, played.sensor),
      node_(MobileParts{.runtime = around.runtime,
                        .network = around.network,
                        .log = around.log,
                        .features = around.features,
                        .feed = *feed_,
                        .sequence = &played.sequence,
                        .sensor = played.sequence.sensor(),
                        .played_fps = played.playlist.played_fps(),
                        .stop_at_first_loss = config.playback.stop_at_first_loss,
                        .timestamps_ns = played.sequence.timestamps_ns(),
                        .time_origin_ns = played.sequence.time_origin_ns(),
                        .prior_map = maps_.prior(),
                        .profile_rtt = config.network ? config.network->profile_rtt : std::nullopt,
                        .images = around.images},
            system, parameters) {}

NodeEnd BuiltMobile::leave(const std::filesystem::path& folder) {
  node_.write_trajectories(folder);
  maps_.save(*node_.tracker().map(), folder);
  NodeEnd end;
  if (node_.finished()) end.reason = "completed";
  end.frames_total = feed_->offered();
  end.counts = node_.counts();
  return end;
}

NodeEnd leave(EdgeNode& node, const std::filesystem::path& folder) {
  node.leave(folder);
  NodeEnd end;
  end.role = NodeRole::kEdge;
  end.reason = node.end_reason();
  end.counts = node.counts();
  return end;
}

}  // namespace slambed
