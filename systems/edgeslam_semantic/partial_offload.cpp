// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/partial_offload.hpp"

#include <algorithm>
#include <cmath>
#include <string>

#include "node/messaging.hpp"
#include "offload/channels/rtt_monitor.hpp"
#include "wire/message_type.hpp"

namespace slambed::edgeslam_semantic {
namespace {

constexpr int kAllLevels = 8;
/// How long the mobile waits for an answer to an upload.
constexpr Duration kPatience = std::chrono::seconds(5);
/// Reasons why a keyframe is uploaded with the whole local map: a restarted edge has no map, or the
/// edge could not decode the map's first upload.
constexpr std::string_view kEdgeRestarted = "restart", kMapRefused = "refused";

LabelOptions label_options(const Parameters& parameters) {
  return {.frames = parameters.integer("label_frames"),
          .border_px = parameters.integer("mask_border_px"),
          .neighbors = parameters.integer("label_neighbors"),
          .reach_px = static_cast<float>(parameters.real("label_reach_px"))};
}

}  // namespace

SemanticMobile::SemanticMobile(MobileNode& node, const Parameters& parameters)
    : node_(node),
      nrcc_(parameters.boolean("nrcc")),
      by_table_(parameters.boolean("adapt")),
      local_references_(parameters.boolean("local_references")),
      record_culling_(parameters.boolean("record_culling")),
      fixed_row_(parameters.integer("fixed_row")),
      most_under_way_(parameters.integer("keyframes_under_way")),
      n_m_(parameters.real("n_m")),
      control_(node.network().open({.name = "control", .heartbeat = true})),
      frames_(
          node.network().open({.name = "frame", .send_queue = parameters.integer("upload_queue")})),
      masks_(node.network().open({.name = "mask"})),
      probes_(node.network().open({.name = "probe"})),
      shutdown_(node, control_),
      uploads_(node, frames_, probes_,
               {.pictures = nrcc_,
                .one_way = parameters.boolean("delay_one_way"),
                .probe_period_s = parameters.real("probe_period_s")}),
      map_(node, {.neighbors = parameters.integer("local_neighbors"),
                  .keyframes = parameters.integer("local_keyframes")}),
      transfer_(label_options(parameters)),
      results_(node.runtime()),
      arrived_masks_(node.runtime()),
      missing_masks_(node.runtime()),
      refusals_(node.runtime()) {
  configure();
}

void SemanticMobile::start() {
  node_.runtime().spawn("results", [this](Worker& worker) { receive_results(worker); });
  node_.runtime().spawn("masks", [this](Worker& worker) { receive_masks(worker); });
  uploads_.start();
  spawn_rtt_monitor(node_.runtime(), node_.log(), frames_);
}

void SemanticMobile::receive_results(Worker& worker) {
  Inbox inbox(node_.log());
  inbox.on<wire::AckMessage>(wire::decode_ack, [this](const auto& ack, const Message& message) {
    uploads_.acknowledged(ack, message.received);
  });
  inbox.on<KeyFrameRefused>(decode_keyframe_refused, [this](const auto& refused, const Message&) {
    refusals_.put(refused.sequence);
  });
  inbox.on(OptResult::kType, [this, &worker](const Message& message) {
    if (auto result = read(worker, "parse", node_.log(), message, decode_opt_result))
      results_.put(std::move(*result));
  });
  while (auto message = frames_.receive(worker, kNever)) inbox.dispatch(std::move(*message));
}

void SemanticMobile::receive_masks(Worker& worker) {
  Inbox inbox(node_.log());
  inbox.on<NoMaskMessage>(decode_no_mask, [this](const NoMaskMessage& missing, const Message&) {
    missing_masks_.put(missing);
  });
  inbox.on(MaskMessage::kType, [this, &worker](const Message& message) {
    auto mask = read(worker, "parse", node_.log(), message,
                     [this](const Bytes& bytes) { return decode_mask(bytes, node_.sensor()); });
    if (mask) arrived_masks_.put(std::move(*mask));
  });
  while (auto message = masks_.receive(worker, kNever)) inbox.dispatch(std::move(*message));
}

void SemanticMobile::before_frame(Worker& worker, const OfferedFrame&) {
  while (const auto result = results_.try_take()) on_result(worker, *result);
  while (const auto mask = arrived_masks_.try_take()) on_mask(worker, *mask);
  while (const auto missing = missing_masks_.try_take()) on_no_mask(*missing);
  while (const auto sequence = refusals_.try_take()) refused(*sequence);
  forget_answered(worker.now());
  moments_.updated = worker.now();
}

void SemanticMobile::on_result(Worker& worker, const OptResult& result) {
  if (!map_.apply(worker, result)) {
    node_.log().write(JsonLine("slice_declined")
                          .add("number", result.number)
                          .add("keyframe", result.keyframe.value));
    return;
  }
  facts_.frames_since_optimization = 0;
  unanswered_ = false;
  for (auto& [id, waiting] : waiting_)
    if (id <= result.keyframe) waiting.result = false;
}

void SemanticMobile::no_longer_waits_for_mask(KeyFrameId keyframe) {
  if (const auto found = waiting_.find(keyframe); found != waiting_.end())
    found->second.mask = false;
}

/// Labels of earlier masks stay valid until they expire.
void SemanticMobile::on_no_mask(const NoMaskMessage& missing) {
  if (missing.map_id != map_.map_id()) return;
  const bool mapped = missing.reason != NoMaskReason::kNotMapped;
  if (mapped) {
    no_longer_waits_for_mask(missing.keyframe);
  } else {
    // Uploads arrive in order, so the edge never got the first one of this map.
    edge_lacks_map_ = true;
    waiting_.erase(missing.keyframe);
  }
  node_.log().write(JsonLine("mask_missing")
                        .add("keyframe", missing.keyframe.value)
                        .add("reason", mapped ? "not segmented" : "not mapped")
                        .add_ms("nrcc_ms", missing.took));
}

/// The edge could not decode an upload, so neither a slice nor a mask will come for it.
void SemanticMobile::refused(std::uint64_t sequence) {
  const auto keyframe = uploads_.keyframe_of(sequence);
  if (!keyframe) return;
  if (*keyframe == map_.map_id()) edge_lacks_map_ = true;
  if (waiting_.erase(*keyframe) == 0) return;
  node_.log().write(JsonLine("keyframe_refused").add("keyframe", keyframe->value));
}

void SemanticMobile::on_mask(Worker& worker, const MaskMessage& mask) {
  no_longer_waits_for_mask(mask.keyframe);
  if (mask.map_id != map_.map_id() || !transfer_.apply(mask.keyframe, mask.masks)) {
    node_.log().write(JsonLine("mask_declined").add("keyframe", mask.keyframe.value));
    return;
  }
  worker.stage("cull_features", [&](StageUnits& units) {
    const Labels labels = transfer_.labels();
    units.n1 = static_cast<double>(labels.size());
    map_.cull(labels);
    return 0;
  });
  node_.log().write(JsonLine("mask_applied")
                        .add("keyframe", mask.keyframe.value)
                        .add("instances", mask.masks.instances.size())
                        .add("age_frames", transfer_.mask_age())
                        .add_ms("nrcc_ms", mask.took));
}

/// Forgets uploads that were fully answered or have timed out.
void SemanticMobile::forget_answered(RunTime now) {
  std::erase_if(waiting_, [&](const auto& entry) {
    const Waiting& waiting = entry.second;
    const bool late = now - waiting.since > kPatience;
    unanswered_ |= late && waiting.result;
    return (!waiting.result && !waiting.mask) || late;
  });
}

std::shared_ptr<const FeatureSet> SemanticMobile::before_tracking(
    Worker& worker, const OfferedFrame& frame, std::shared_ptr<const FeatureSet> features) {
  moments_.extracted = worker.now();
  features_ = features->size();
  worker.stage("match_features", [&](StageUnits& units) {
    units.n1 = features_;
    transfer_.track(features, frame.played.seq_s());
    return 0;
  });
  if (record_culling_) log_features(frame, *features);
  const auto& free = transfer_.free();
  if (std::find(free.begin(), free.end(), 0) != free.end()) {
    features = worker.stage("cull_features", [&](StageUnits& units) {
      units.n1 = features_;
      return select(*features, free);
    });
  }
  moments_.culled = worker.now();
  return features;
}

/// Logs distorted pixel coordinates, because masks are in the raw picture. They are scored after
/// the run against the sequence's labels, which no node reads.
void SemanticMobile::log_features(const OfferedFrame& frame, const FeatureSet& features) const {
  const Camera& camera = features.sensor().camera;
  const auto& free = transfer_.free();
  std::string kept, culled;
  for (int i = 0; i < features.size(); ++i) {
    const Eigen::Vector2d at = camera.distort(features.keypoint(i).u, features.keypoint(i).v);
    std::string& where = free[static_cast<std::size_t>(i)] ? kept : culled;
    where += std::to_string(std::lround(at.x())) + ' ' + std::to_string(std::lround(at.y())) + ' ';
  }
  node_.log().write(JsonLine("frame_features")
                        .add("frame", frame.played.index)
                        .add("kept", kept)
                        .add("culled", culled));
}

void SemanticMobile::report(Worker& worker, const TrackedFrame& frame) {
  const RunTime now = worker.now(), offered = frame.offered.offered;
  const Duration wait = frame.offered.dequeued - offered;
  const Duration update = moments_.updated - frame.offered.dequeued;
  const Duration extract = moments_.extracted - moments_.updated;
  const Duration match = moments_.culled - moments_.extracted, track = now - moments_.culled;
  const Duration parts = wait + update + extract + match + track, whole = now - offered;
  node_.log().write(JsonLine("frame_answered")
                        .add("frame", frame.offered.played.index)
                        .add("ok", frame.outcome.state == TrackingState::kOk)
                        .add("features", features_)
                        .add("culled", features_ - frame.features->size())
                        .add("mask_age_frames", transfer_.mask_age())
                        .add("matched_share", transfer_.compared_features() > 0
                                                  ? static_cast<double>(transfer_.matched()) /
                                                        transfer_.compared_features()
                                                  : 0.0)
                        .add_ms("wait_ms", wait)
                        .add_ms("update_ms", update)
                        .add_ms("extract_ms", extract)
                        .add_ms("match_ms", match)
                        .add_ms("track_ms", track)
                        .add_ms("latency_ms", whole)
                        .add_ms("parts_error_ms", whole > parts ? whole - parts : parts - whole));
}

void SemanticMobile::after_frame(Worker& worker, const TrackedFrame& frame) {
  report(worker, frame);
  // Table I counts frames of a camera whose frames are all tracked, so those that a busy device
  // drops count, too.
  const std::size_t place = frame.offered.played.place;
  const int passed = static_cast<int>(place + 1 - next_place_);
  next_place_ = place + 1;
  if (frame.outcome.reset_now) reset();
  if (frame.outcome.state != TrackingState::kOk) return;
  facts_.frames_since_keyframe += passed;
  facts_.frames_since_optimization += passed;
  if (frame.outcome.initialized_now) {
    reset();
    return make_keyframe(worker, frame, "first");
  }
  if (const auto reason = begin_anew()) return make_keyframe(worker, frame, reason);
  if (const auto reason = choose()) return make_keyframe(worker, frame, reason);
  if (local_references_ && node_.tracker().wants_keyframe({})) make_keyframe(worker, frame, {});
}

/// Returns the reason why the edge needs the mobile's whole local map, or nothing.
std::optional<std::string_view> SemanticMobile::begin_anew() const {
  const PeerState edge = node_.network().peer();
  if (!map_.map_id() || !edge.connected) return std::nullopt;
  if (edge.session != edge_session_) return kEdgeRestarted;
  if (edge_lacks_map_) return kMapRefused;
  return std::nullopt;
}

/// Returns the reason why the frame is uploaded as a keyframe, or nothing.
std::optional<std::string_view> SemanticMobile::choose() {
  if (!by_table_) {
    if (!waiting_.empty()) return std::nullopt;
    return "answered";
  }
  facts_.keyframes = map_.uploaded();
  facts_.features = features_;
  facts_.keyframe_features = transfer_.compared_features();
  facts_.matched = transfer_.matched();
  const Selection selection = select_keyframe(configuration_, facts_);
  if (selection == Selection::kForced) return "forced";
  if (most_under_way_ > 0 && std::ssize(waiting_) >= most_under_way_) return std::nullopt;
  if (node_.tracker().keyframe_need() == KeyFrameNeed::kUrgent) return "urgent";
  if (selection == Selection::kByRule) return "rule";
  return std::nullopt;
}

/// Selects the configuration. Called only at uploads, so the row of Table I changes only there.
void SemanticMobile::configure() {
  const int row = fixed_row_ > 0 ? fixed_row_ : row_for(uploads_.delay());
  if (by_table_) {
    if (row != row_) {
      JsonLine event("row_changed");
      event.add("row_before", row_).add("row", row);
      if (const auto delay = uploads_.delay()) event.add_ms("n_ms", *delay);
      node_.log().write(event);
    }
    row_ = row;
    configuration_ = table_row(row);
  } else {
    row_ = 0;
    configuration_ = Configuration();
    configuration_.levels = kAllLevels;
    configuration_.n_m = n_m_;
  }
  node_.use_levels(configuration_.levels);
}

/// Makes a keyframe. With a reason it is uploaded; without one it is a local reference only.
void SemanticMobile::make_keyframe(Worker& worker, const TrackedFrame& frame,
                                   std::optional<std::string_view> reason) {
  const KeyFrameNeed need = node_.tracker().keyframe_need();
  const MapDelta made = node_.create_keyframe(worker, frame, need, true);
  if (made.keyframes.empty()) return;
  const KeyFrameId id = made.keyframes.back().id;
  map_.extend(worker, made);
  if (!reason) return transfer_.keep(id);
  transfer_.keep_for_comparison(id);
  configure();
  const bool again = reason == kEdgeRestarted || reason == kMapRefused;
  SemanticKeyFrame message = again ? map_.upload_whole(id) : map_.upload(made);
  if (message.first()) {
    edge_session_ = node_.network().peer().session;
    edge_lacks_map_ = unanswered_ = false;
  }
  if (again) waiting_.clear();
  if (reason == kEdgeRestarted) {
    node_.log().write(
        JsonLine("edge_restarted").add("keyframe", id.value).add("session", edge_session_));
  }
  message.captured = frame.offered.offered;
  message.n_m = configuration_.n_m;
  waiting_[id] = {.result = true, .mask = nrcc_, .since = worker.now()};
  facts_.frames_since_keyframe = 0;
  uploads_.put(std::move(message),
               {.reason = *reason, .row = row_, .levels = configuration_.levels});
  if (unanswered_) map_.keep_newest(worker);
}

void SemanticMobile::reset() {
  map_.reset();
  transfer_.clear();
  waiting_.clear();
  facts_ = {};
}

void SemanticMobile::finish(Worker& worker) {
  uploads_.drain(worker);
  shutdown_.shut_down(worker, uploads_.last_sequence());
}

void SemanticMobile::place_keyframes(PoseBook& book) { shutdown_.place_keyframes(book); }

}  // namespace slambed::edgeslam_semantic
