// SPDX-License-Identifier: Apache-2.0
#include "cloudslam/remote_mapping.hpp"

#include <algorithm>
#include <limits>

#include "features/default_vocabulary.hpp"
#include "node/completion.hpp"
#include "node/messaging.hpp"
#include "wire/message_type.hpp"
#include "wire/trip_messages.hpp"

namespace slambed {

RemoteMapping::RemoteMapping(EdgeNode& node, Channel& keyframes, RemoteMappingOptions options)
    : node_(node),
      channel_(keyframes),
      options_(std::move(options)),
      prior_(open_prior_map(options_.prior_map, IdSpace::kEdgeMapper)),
      places_(std::make_shared<PlaceIndex>(default_vocabulary())),
      mapper_(options_.mapper, prior_.map, places_),
      queue_(node.runtime(), static_cast<std::size_t>(options_.queue)),
      progressed_(node.runtime().make_signal()) {
  places_->update_from(*prior_.map);  // only once: the index covers the earlier trips alone
  check_rig(prior_, node_.peer());
}

void RemoteMapping::start() {
  check_rig(prior_, node_.peer());
  node_.runtime().spawn("receiver", [this](Worker& worker) { receive(worker); });
  node_.runtime().spawn("remote-mapping", [this](Worker& worker) { work(worker); });
}

void RemoteMapping::receive(Worker& worker) {
  while (const auto message = channel_.receive(worker, kNever)) {
    if (is(*message, wire::kKeyFrame) || is(*message, wire::kTripStart)) {
      check_rig(prior_, node_.peer());
      on_keyframe(worker, *message);
    }
    received_sequence_ = message->sequence;
    progressed_->notify();
  }
}

void RemoteMapping::on_keyframe(Worker& worker, const Message& raw) {
  Received item{.message = {},
                .estimated = is(raw, wire::kKeyFrame),
                .sent = raw.sent,
                .received = raw.received};
  const bool parsed = worker.stage(options_.codec.parse_stage(), [&](StageUnits& units) {
    auto keyframe = read(node_.log(), raw, [&](const Bytes& filled) {
      const auto own = wire::without_filler(filled);
      const Bytes bytes(own.begin(), own.end());
      units.n1 = kilobytes(bytes);
      return options_.codec.keyframe(worker, bytes, node_.peer().sensor());
    });
    if (keyframe) item.message = std::move(*keyframe);
    return keyframe.has_value();
  });
  if (!parsed) return;
  node_.log().write(JsonLine("keyframe_received").add("keyframe", item.message.keyframe.value));
  ++open_;
  const auto dropped = queue_.put(std::move(item));
  if (!dropped) return;
  --open_;
  node_.log().write(JsonLine("remote_dropped")
                        .add("keyframe", dropped->message.keyframe.value)
                        .add("reason", "queue full"));
}

void RemoteMapping::work(Worker& worker) {
  while (auto received = queue_.take(worker)) {
    answer(worker, std::move(*received));
    --open_;
    progressed_->notify();
  }
}

void RemoteMapping::answer(Worker& worker, Received received) {
  const KeyFrameId id = received.message.keyframe;
  const RunTime begun = worker.now();
  RemoteMapper::Match match;
  worker.stage(
      "remote_match",
      [&](StageUnits& units) {
        match = mapper_.match(received.message.delta, received.estimated);
        units.n1 = match.tried;
        units.n2 = received.message.delta.keyframes.front().features->size();
        return 0;
      },
      [&](int) { prior_.map->commit(match.delta); });
  const RunTime matched = worker.now();
  if (match.matched) bundle(worker, id);
  constexpr int kMost = std::numeric_limits<std::uint16_t>::max();
  wire::PoseAnswer answer{.keyframe = id,
                          .matches = static_cast<std::uint16_t>(std::min(match.matches, kMost)),
                          .T_cw = {},
                          .sent = received.sent,
                          .up = received.received - received.sent,
                          .wait = begun - received.received,
                          .match = matched - begun,
                          .bundle = worker.now() - matched};
  if (match.matched)
    answer.T_cw = prior_.map->read([&](const MapView& view) { return view.keyframe(id)->T_cw; });
  send(channel_, received.estimated ? wire::kPoseUpdate : wire::kInitialPose, encode(answer));
  node_.log().write(JsonLine("remote_matched")
                        .add("keyframe", id.value)
                        .add("candidates", match.tried)
                        .add("matches", match.matches)
                        .add("matched", static_cast<bool>(match.matched)));
}

void RemoteMapping::bundle(Worker& worker, KeyFrameId keyframe) {
  const auto size = [&] { return static_cast<double>(mapper_.bundle_observations()); };
  const bool begun = worker.stage("remote_bundle", [&](StageUnits& units) {
    const bool usable = mapper_.begin_bundle(keyframe);
    units.n1 = size();
    return usable;
  });
  if (!begun) return;
  while (worker.stage("remote_bundle", [&](StageUnits& units) {
    units.n2 = size();
    return mapper_.step_bundle();
  })) {
  }
  worker.stage(
      "remote_bundle",
      [&](StageUnits& units) {
        units.n2 = size();
        return mapper_.finish_bundle();
      },
      [&](const MapDelta& delta) { prior_.map->commit(delta); });
}

void RemoteMapping::drain(Worker& worker, std::uint64_t last_sequence, RunTime transit,
                          RunTime deadline) {
  const auto never = [] { return false; };
  Completion(
      *progressed_, [&] { return received_sequence_ >= last_sequence; }, never)
      .wait(worker, transit);
  Completion(
      *progressed_, [&] { return open_ == 0; }, never)
      .wait(worker, deadline);
}

}  // namespace slambed
