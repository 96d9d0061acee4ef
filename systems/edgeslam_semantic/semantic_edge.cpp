// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/semantic_edge.hpp"

#include <algorithm>

#include "node/messaging.hpp"
#include "offload/uplink/admission.hpp"
#include "wire/message_type.hpp"

namespace slambed::edgeslam_semantic {
namespace {

/// Keyframes that may wait for the mapper. Edge-SLAM's value, as the paper gives none.
constexpr int kQueueLimit = 3;

EdgeMapperOptions mapper_options(const Parameters& parameters) {
  return {.queue_limit = kQueueLimit, .loop_closing = parameters.boolean("loop_closing")};
}

}  // namespace

MapDelta as_known_here(const MapView& view, MapDelta delta) {
  std::map<MapPointId, MapPointId> renamed;
  std::erase_if(delta.attach, [&](const ObservationEdit& edit) {
    const KeyFrame* keyframe = view.keyframe(edit.keyframe);
    if (!keyframe || edit.feature >= keyframe->points.size()) return true;
    const MapPointId here = keyframe->points[edit.feature];
    if (here) renamed[edit.point] = here;
    return static_cast<bool>(here);
  });
  for (NewKeyFrame& keyframe : delta.keyframes) {
    for (MapPointId& id : keyframe.points)
      if (const auto other = renamed.find(id); other != renamed.end()) id = other->second;
  }
  std::erase_if(delta.points, [&](const NewPoint& p) { return renamed.contains(p.id); });
  for (ObservationEdit& edit : delta.attach)
    if (const auto other = renamed.find(edit.point); other != renamed.end())
      edit.point = other->second;
  return rebase_keyframe(view, std::move(delta));
}

SemanticEdge::SemanticEdge(EdgeNode& node, const Parameters& parameters)
    : node_(node),
      border_px_(parameters.integer("mask_border_px")),
      window_keyframes_(parameters.integer("local_keyframes")),
      control_(node.network().open({.name = "control", .heartbeat = true})),
      frames_(node.network().open({.name = "frame"})),
      masks_(node.network().open({.name = "mask"})),
      probes_(node.network().open({.name = "probe"})),
      mapper_(node, mapper_options(parameters),
              {.begun = [] {},
               .mapped = [this](Worker& worker,
                                const wire::UpdateTimes& times) { mapped(worker, times); },
               .idle = [this](Worker& worker) { return idle(worker); },
               .cleared =
                   [this] {
                     map_id_ = last_map_id_.value;
                     begun_anew_ = true;
                   },
               .rebase = as_known_here}),
      shutdown_(node, control_, *this, {}),
      pictures_(node.runtime()),
      segmented_(node.runtime()),
      received_(node.runtime().make_signal()) {
  if (parameters.boolean("nrcc"))
    segmentation_.emplace(node, from_seconds(parameters.real("nrcc_floor_ms") / 1000));
}

void SemanticEdge::start() {
  mapper_.start();
  node_.runtime().spawn("receiver", [this](Worker& worker) { receive(worker); });
  node_.runtime().spawn("probe", [this](Worker& worker) { answer_probes(worker); });
  if (segmentation_) node_.runtime().spawn("nrcc", [this](Worker& worker) { segment(worker); });
  shutdown_.start();
}

void SemanticEdge::receive(Worker& worker) {
  Inbox inbox(node_.log());
  inbox.on(SemanticKeyFrame::kType, [this, &worker](const Message& message) {
    send(frames_, wire::AckMessage{message.sequence});
    auto keyframe = read(worker, "parse", node_.log(), message, [this](const Bytes& bytes) {
      return decode_semantic_keyframe(bytes, node_.peer().sensor());
    });
    if (keyframe) {
      on_keyframe(worker, std::move(*keyframe), message);
    } else {
      send(frames_, KeyFrameRefused{message.sequence});
    }
  });
  while (auto message = frames_.receive(worker, kNever)) {
    const std::uint64_t sequence = message->sequence;
    inbox.dispatch(std::move(*message));
    received_sequence_ = sequence;
    received_->notify();
  }
}

std::optional<std::string_view> SemanticEdge::objection(const SemanticKeyFrame& message) const {
  if (message.first()) return std::nullopt;
  if (message.map_id != last_map_id_) return "of another map";
  if (message.keyframe() <= last_) return "older than the last";
  return std::nullopt;
}

void SemanticEdge::on_keyframe(Worker& worker, SemanticKeyFrame message, const Message& raw) {
  const KeyFrameId id = message.keyframe();
  if (const auto reason = objection(message)) {
    node_.log().write(
        JsonLine("keyframe_declined").add("keyframe", id.value).add("reason", *reason));
    report_no_mask(message.map_id, id, worker.now() - raw.received, NoMaskReason::kNotMapped);
    return;
  }
  last_ = id;
  last_map_id_ = message.map_id;
  // When a new map replaces an old one, `cleared` sets it: slices are of the old map until then.
  if (map_id_ == 0) map_id_ = last_map_id_.value;
  if (segmentation_ && !message.jpeg.empty())
    pictures_.put({message.map_id, id, message.delta.keyframes.back().frame_index, message.n_m,
                   std::move(message.jpeg), raw.received});
  AdmittedKeyFrame admitted;
  admitted.message.keyframe = id;
  admitted.message.captured = message.captured;
  admitted.message.first = admitted.message.whole = message.first();
  admitted.message.applied_update = message.applied_slice;
  admitted.message.newest_edge_point = message.newest_edge_point;
  admitted.message.delta = std::move(message.delta);
  admitted.times.captured = message.captured;
  admitted.times.queued = raw.queued;
  admitted.times.received = raw.received;
  mapper_.admit(worker, std::move(admitted));
}

void SemanticEdge::answer_probes(Worker& worker) {
  while (const auto message = probes_.receive(worker, kNever))
    if (is(*message, wire::kProbe)) send(probes_, wire::AckMessage{message->sequence});
}

void SemanticEdge::segment(Worker& worker) {
  while (const auto picture = pictures_.take(worker)) {
    auto masks = segmentation_->run(worker, picture->frame, picture->jpeg, picture->n_m);
    if (!masks) {
      report_no_mask(picture->map_id, picture->keyframe, worker.now() - picture->arrived,
                     NoMaskReason::kNotSegmented);
      continue;
    }
    // The mobile only culls, so it needs neither static instances nor body joints.
    std::erase_if(masks->instances, [](const Instance& instance) { return !instance.moves; });
    for (Instance& instance : masks->instances) instance.body.reset();
    send(masks_, MaskMessage{.map_id = picture->map_id,
                             .keyframe = picture->keyframe,
                             .took = worker.now() - picture->arrived,
                             .masks = *masks});
    segmented_.put({picture->map_id, picture->keyframe, std::move(*masks)});
    mapper_.wake();
  }
}

void SemanticEdge::report_no_mask(KeyFrameId map_id, KeyFrameId keyframe, Duration took,
                                  NoMaskReason reason) {
  send(masks_,
       NoMaskMessage{.map_id = map_id, .keyframe = keyframe, .took = took, .reason = reason});
}

/// Resets the mapping worker's state after the map was cleared.
void SemanticEdge::forget_old_map() {
  if (!begun_anew_.exchange(false)) return;
  labels_.clear();
  window_ = {};
  oldest_ = {};
  number_ = sent_corrections_ = 0;
}

RunTime SemanticEdge::idle(Worker& worker) {
  forget_old_map();
  cull_labeled(worker);
  // A closed loop or a global bundle adjustment moves the mobile's local map.
  if (number_ > 0 && mapper_.loop_corrections() != sent_corrections_) send_slice(worker, times_);
  return kNever;
}

void SemanticEdge::mapped(Worker& worker, const wire::UpdateTimes& times) {
  forget_old_map();
  times_ = times;
  cull_labeled(worker);
  send_slice(worker, times);
}

/// Culls points on what moves when their mask arrives, and again after each mapped keyframe,
/// because mapping may have made new ones.
void SemanticEdge::cull_labeled(Worker& worker) {
  while (auto mask = segmented_.try_take()) {
    if (mask->map_id.value != map_id_) continue;
    const auto features = mapper_.map()->read([&](const MapView& view) {
      const KeyFrame* keyframe = view.keyframe(mask->keyframe);
      return keyframe ? keyframe->features : nullptr;
    });
    if (!features) {
      // The keyframe is either not mapped yet or culled. In the first case the mask is kept.
      if (mask->keyframe > mapper_.newest()) {
        segmented_.put(std::move(*mask));
        break;
      }
      continue;
    }
    labels_[mask->keyframe] = features_on_masks(*features, mask->masks, border_px_);
  }
  if (labels_.empty()) return;
  worker.stage(
      "cull_features",
      [&](StageUnits& units) {
        units.n1 = static_cast<double>(labels_.size());
        return mapper_.map()->read(
            [&](const MapView& view) { return without_labeled(view, labels_); });
      },
      [&](const MapDelta& delta) { mapper_.map()->commit(delta); });
  // Labels of keyframes outside the window cull only once; those inside are kept for later points.
  mapper_.map()->read([&](const MapView& view) {
    std::erase_if(labels_, [&](const auto& entry) {
      return entry.first < oldest_ || !view.keyframe(entry.first);
    });
    return 0;
  });
}

std::vector<KeyFrameId> SemanticEdge::local_keyframes() {
  std::vector<KeyFrameId> newest = mapper_.latest(window_keyframes_);
  std::erase_if(newest, [this](KeyFrameId id) { return id < oldest_; });
  if (!newest.empty()) oldest_ = *std::min_element(newest.begin(), newest.end());
  return newest;
}

void SemanticEdge::send_slice(Worker& worker, wire::UpdateTimes times) {
  OptResult result;
  result.map_id = KeyFrameId{map_id_};
  result.keyframe = mapper_.newest();
  result.times = times;
  result.times.due = worker.now();
  sent_corrections_ = mapper_.loop_corrections();
  const bool prepared = worker.stage("prepare_update", [&](StageUnits& units) {
    const auto keyframes = local_keyframes();
    return mapper_.read_for_update([&](std::uint64_t number) {
      return mapper_.map()->read([&](const MapView& view) {
        const KeyFrame* keyframe = view.keyframe(result.keyframe);
        if (!keyframe) return false;
        result.number = number_ = number;
        result.T_cw = keyframe->T_cw;
        MapWindow now = window_of(view, keyframes);
        MapSlice slice = difference(window_, now, view);
        units = {static_cast<double>(keyframes.size()), static_cast<double>(now.points.size())};
        window_ = std::move(now);
        result.changes = std::move(slice.changes);
        result.left_keyframes = std::move(slice.left_keyframes);
        result.left_points = std::move(slice.left_points);
        return true;
      });
    });
  });
  if (!prepared) return;
  Bytes bytes = worker.stage("serialize", [&](StageUnits& units) {
    Bytes written = encode(result);
    units.n1 = kilobytes(written);
    return written;
  });
  node_.log().write(JsonLine("slice_sent")
                        .add("number", result.number)
                        .add("keyframe", result.keyframe.value)
                        .add("points_set", result.changes.positions.size())
                        .add("labeled_keyframes", labels_.size())
                        .add("bytes", bytes.size()));
  send(frames_, OptResult::kType, std::move(bytes));
}

void SemanticEdge::drain(Worker& worker, std::uint64_t last_sequence, RunTime transit,
                         RunTime deadline) {
  Completion(
      *received_, [&] { return received_sequence_ >= last_sequence; }, [] { return false; })
      .wait(worker, transit);
  mapper_.drain(worker, deadline);
}

}  // namespace slambed::edgeslam_semantic
