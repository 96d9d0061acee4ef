// SPDX-License-Identifier: Apache-2.0
#include "offload/settings.hpp"

#include "base/error.hpp"
#include "node/tracking_options.hpp"
#include "offload/original_behaviour.hpp"

namespace slambed {
namespace {

bool compatible(const Parameters& parameters) {
  return parameters.text("codec") == "compatibility";
}

bool keeps_recovery(const Parameters& parameters) {
  return relocalises_on_edge(parameters) && parameters.boolean("keep_recovery_keyframe");
}

}  // namespace

System offload_system(std::string name, std::vector<ParameterSpec> specs) {
  System system;
  system.name = std::move(name);
  system.channels = {"control", "keyframe", "map", "frame"};
  system.parameters = std::move(specs);
  system.orb = orb_options;
  system.tracker = [](const Parameters& parameters) {
    const OriginalBehaviour behaviour = original_behaviour(parameters);
    TrackerOptions options = tracker_options(parameters, behaviour.tracker);
    if (behaviour.max_frames > 0) {
      options.max_frames_between_keyframes = behaviour.max_frames;
      options.max_frames_is_a_second = false;
    }
    // The local map is small by design: being lost in it is a case for relocalisation.
    options.reset_below_keyframes = 0;
    options.begins_lost = !edge_prior_map(parameters).empty();
    return options;
  };
  system.sequential = [](const Parameters&) { return false; };
  return system;
}

MessageCodec message_codec(const Parameters& parameters) {
  return MessageCodec(compatible(parameters) ? MessageCodec::Form::kCompatibility
                                             : MessageCodec::Form::kBinary);
}

OffloadChannels::OffloadChannels(Runtime& runtime, Network& network, Observer& observer,
                                 const Parameters& parameters)
    : control(network.open({.name = "control", .heartbeat = true})),
      keyframe(open(runtime, network, observer, compatible(parameters),
                    {.name = "keyframe",
                     .send_queue = parameters.integer("keyframe_queue"),
                     .receive_queue = parameters.integer("keyframe_queue")})),
      map(open(runtime, network, observer, compatible(parameters),
               {.name = "map", .receive_queue = 1})),
      frame(open(runtime, network, observer, compatible(parameters),
                 {.name = "frame", .send_queue = 1, .receive_queue = 1})) {}

Channel& OffloadChannels::open(Runtime& runtime, Network& network, Observer& observer, bool waits,
                               const ChannelOptions& options) {
  if (!waits) return network.open(options);
  Channel& below = network.open({.name = options.name, .max_payload = options.max_payload});
  waiting_.push_back(std::make_unique<StopAndWaitChannel>(runtime, observer, below, options));
  return *waiting_.back();
}

void OffloadChannels::start() {
  for (const auto& channel : waiting_) channel->start();
}

DownlinkOptions downlink_options(const Parameters& parameters, const MessageCodec& codec) {
  DownlinkOptions options{
      .rules = {.min_local_keyframes = parameters.integer("min_local_keyframes"),
                .fast_motion = from_seconds(parameters.real("fast_motion_ms") / 1000),
                .local_map_size = original_behaviour(parameters).local_map_size,
                .keyframe_rate_hz = parameters.real("decline_kf_rate_hz")},
      .codec = codec};
  if (keeps_recovery(parameters)) options.recovery_keyframes = parameters.integer("n_kf");
  const std::string mode = parameters.text("map_update");
  if (mode == "parallel") options.mode = MapUpdateMode::kParallel;
  if (mode == "parallel_waiting") options.mode = MapUpdateMode::kParallelWaiting;
  if (mode == "staged") {
    options.mode = MapUpdateMode::kStaged;
    const std::string backup = parameters.text("keyframe_backup");
    options.backup = backup == "none"     ? MapStaging::Backup::kNone
                     : backup == "update" ? MapStaging::Backup::kUpdate
                                          : MapStaging::Backup::kUncovered;
  }
  return options;
}

EdgeMappingOptions mapping_options(const Parameters& parameters, const MessageCodec& codec) {
  const OriginalBehaviour behaviour = original_behaviour(parameters);
  return {.mapper = {.queue_limit = parameters.integer("edge_queue"),
                     .loop_closing = parameters.boolean("loop_closing"),
                     .max_frames = behaviour.max_frames,
                     .mapping = {.ages_by_id = behaviour.culls_by_id, .bundle = {}}},
          .updates = {.keyframes = parameters.integer("n_kf"),
                      .neighbours = parameters.integer("update_neighbours"),
                      .period = from_seconds(parameters.real("sync_period_s")),
                      .first = behaviour.first_update_s < 0
                                   ? std::nullopt
                                   : std::optional(from_seconds(behaviour.first_update_s)),
                      .poses = parameters.boolean("update_poses"),
                      .keep_recovery = keeps_recovery(parameters),
                      .codec = codec},
          .prior_map = edge_prior_map(parameters),
          .admission_when_idle = behaviour.admission_when_idle};
}

std::string edge_prior_map(const Parameters& parameters) {
  if (!parameters.has("prior_map")) return {};
  const std::string path = parameters.text("prior_map");
  // RELOC_OK has one keyframe, from which the mobile could not tell which ids the map has taken.
  if (!path.empty() && relocalises_on_edge(parameters))
    throw bad_input(
        "params: prior_map needs relocalisation: map, by which the mobile begins in it");
  return path;
}

bool relocalises_on_edge(const Parameters& parameters) {
  return parameters.has("relocalisation") && parameters.text("relocalisation") == "edge";
}

}  // namespace slambed
