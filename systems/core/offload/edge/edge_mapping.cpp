// SPDX-License-Identifier: Apache-2.0
#include "offload/edge/edge_mapping.hpp"

namespace slambed {

namespace {

std::optional<PriorMap> prior_of(const EdgeMappingOptions& options) {
  if (options.prior_map.empty()) return std::nullopt;
  return open_prior_map(options.prior_map, IdSpace::kTracker);
}

EdgeMapperOptions with(EdgeMapperOptions options, const std::optional<PriorMap>& prior) {
  if (prior) options.prior = prior->map;
  return options;
}

}  // namespace

EdgeMapping::EdgeMapping(EdgeNode& node, const EdgeMappingOptions& options, Channel& keyframes,
                         Channel& map)
    : node_(node),
      prior_(prior_of(options)),
      mapper_(node, with(options.mapper, prior_),
              {.received =
                   [this](const wire::KeyFrameMessage& message) {
                     updates_.keyframe_received(message);
                   },
               .begun = [this] { intake_.look(); },
               .mapped = [this](Worker& worker,
                                const wire::UpdateTimes& times) { updates_.mapped(worker, times); },
               .idle =
                   [this](Worker& worker) {
                     intake_.look();
                     return updates_.send_if_due(worker);
                   },
               .cleared = [this] { updates_.clear(); }}),
      updates_(node, mapper_, options.updates, map),
      intake_(node, keyframes, options.updates.codec, mapper_) {
  if (options.admission_when_idle)
    intake_.wait_for_mapper([this] { return mapper_.status().idle; });
}

void EdgeMapping::start() {
  mapper_.start();
  intake_.start();
  if (!prior_) return;
  node_.runtime().spawn("prior-map", [this](Worker& worker) { check_prior(worker); });
}

/// Checks the prior map's camera as soon as the mobile has sent its own.
void EdgeMapping::check_prior(Worker& worker) {
  Signal& greeted = node_.network().peer_signal();
  while (!worker.stopping()) {
    const auto ticket = greeted.ticket();
    check_rig(*prior_, node_.peer());
    if (node_.peer().info()) return;
    worker.wait(greeted, ticket, kNever);
  }
}

void EdgeMapping::drain(Worker& worker, std::uint64_t last_sequence, RunTime transit,
                        RunTime deadline) {
  intake_.wait_for(worker, last_sequence, transit);
  mapper_.drain(worker, deadline);
}

void EdgeMapping::stop() {
  mapper_.park(true);
  updates_.stop();
}

void EdgeMapping::resume(std::uint64_t epoch) {
  updates_.resume(epoch);
  mapper_.park(false);
}

}  // namespace slambed
