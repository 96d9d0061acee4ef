// SPDX-License-Identifier: Apache-2.0
#include "offload/edge/edge_mapper.hpp"

#include <algorithm>

#include "features/default_vocabulary.hpp"
#include "offload/maps/map_sync.hpp"
#include "offload/maps/update_content.hpp"
#include "offload/uplink/admission.hpp"

namespace slambed {
namespace {

/// Fills the list with covisibles of its newest keyframe: the camera need not be near the last one.
void add_covisibles(const MapView& view, int count, std::vector<KeyFrameId>& found) {
  for (const Covisible& near : view.keyframe(found.front())->covisibles) {
    if (std::ssize(found) == count) return;
    if (std::find(found.begin(), found.end(), near.id) == found.end()) found.push_back(near.id);
  }
}

}  // namespace

EdgeMapper::EdgeMapper(EdgeNode& node, EdgeMapperOptions options, EdgeHooks hooks)
    : node_(node),
      options_(std::move(options)),
      hooks_(std::move(hooks)),
      map_(options_.prior ? options_.prior : std::make_shared<Map>()),
      places_(std::make_shared<PlaceIndex>(default_vocabulary())),
      mapping_(node.runtime(), node.log(), options_.mapping, map_, IdSpace::kEdgeMapper,
               LocalMapping::Mode::kWorker, mapping_hooks()) {
  places_->update_from(*map_);
  admitted_ = map_->read([](const MapView& view) { return view.keyframe_ids(); });
  mapped_keyframes_ = admitted_;
  begun_with_ = admitted_.size();
  if (!options_.loop_closing) return;
  loops_.emplace(node.runtime(), node.log(), LoopCloserOptions(), map_, places_, mapping_,
                 LocalMapping::Mode::kWorker,
                 [this](const MapDelta& delta) { corrections_.commit(*map_, delta); });
}

MappingHooks EdgeMapper::mapping_hooks() {
  return {.prepare = [this](Worker&, KeyFrameId id) { return insert_pending(id); },
          .done = [this](Worker& worker, KeyFrameId id) { mapped(worker, id); },
          .idle =
              [this](Worker& worker) {
                if (loops_) loops_->idle(worker);
                return hooks_.idle(worker);
              },
          .changed =
              [this] {
                if (loops_) loops_->map_changed();
              }};
}

void EdgeMapper::start() {
  mapping_.start();
  if (loops_) loops_->start();
}

std::optional<std::string_view> EdgeMapper::keyframe_decline_reason(
    const wire::KeyFrameMessage& message) const {
  AdmissionState state{.mapper = mapping_.status(),
                       .keyframes = count(*map_).keyframes,
                       .last_accepted_s = -1,
                       .played_fps = node_.peer().played_fps(),
                       .queue_limit = options_.queue_limit,
                       .max_frames = options_.max_frames};
  {
    std::lock_guard lock(mutex_);
    state.last_accepted_s = last_admitted_s_;
  }
  return slambed::keyframe_decline_reason(message, state);
}

void EdgeMapper::admit(Worker& worker, AdmittedKeyFrame keyframe) {
  const KeyFrameId id = keyframe.message.keyframe;
  bool begun = false;
  {
    std::lock_guard lock(mutex_);
    begun = last_admitted_s_ >= 0;
  }
  if (keyframe.message.first && begun) clear(worker);
  node_.log().write(JsonLine("keyframe_received").add("keyframe", id.value));
  keyframe.times.accepted = worker.now();
  {
    std::lock_guard lock(mutex_);
    last_admitted_s_ = keyframe.message.delta.keyframes.back().timestamp_s;
    auto& pending = pending_[id];
    pending = {keyframes_of(keyframe.message.delta), std::move(keyframe)};
    admitted_.insert(admitted_.end(), pending.ids.begin(), pending.ids.end());
  }
  mapping_.submit(worker, id);
}

/// The mobile has started a new map.
void EdgeMapper::clear(Worker& worker) {
  mapping_.reset(map_).wait(worker);
  map_->clear();
  corrections_.forget();
  {
    std::lock_guard lock(mutex_);
    pending_.clear();
    admitted_.clear();
    mapped_keyframes_.clear();
    begun_with_ = 0;
  }
  hooks_.cleared();
}

bool EdgeMapper::insert_pending(KeyFrameId keyframe) {
  MapDelta delta;
  std::uint64_t applied = 0;
  {
    std::lock_guard lock(mutex_);
    const auto found = pending_.find(keyframe);
    if (found == pending_.end()) return false;
    wire::KeyFrameMessage& message = found->second.keyframe.message;
    delta = std::move(message.delta);
    applied = message.applied_update;
    mapping_.skip(message.newest_edge_point);
  }
  delta = map_->read([&](const MapView& view) {
    return hooks_.rebase ? hooks_.rebase(view, std::move(delta))
                         : rebase_keyframe(view, std::move(delta));
  });
  map_->commit(corrections_.correct(*map_, std::move(delta), applied));
  hooks_.begun();
  return true;
}

void EdgeMapper::mapped(Worker& worker, KeyFrameId keyframe) {
  wire::UpdateTimes times;
  {
    std::lock_guard lock(mutex_);
    const auto found = pending_.find(keyframe);
    if (found == pending_.end()) return;
    times = found->second.keyframe.times;
    times.mapped = worker.now();
    const auto& ids = found->second.ids;
    mapped_keyframes_.insert(mapped_keyframes_.end(), ids.begin(), ids.end());
    pending_.erase(found);
  }
  places_->update_from(*map_);
  hooks_.mapped(worker, times);
  if (loops_) loops_->mapped(worker, keyframe);
}

std::vector<KeyFramePose> EdgeMapper::all_poses() const {
  std::vector<KeyFrameId> ids;
  {
    std::lock_guard lock(mutex_);
    ids = admitted_;
  }
  return map_->read([&](const MapView& view) {
    std::vector<KeyFramePose> poses;
    for (const KeyFrameId id : ids) {
      const KeyFrame* keyframe = view.keyframe(id);
      if (const auto pose = view.pose_of(id)) {
        poses.push_back({id, *pose, keyframe ? keyframe->version : 0});
      }
    }
    return poses;
  });
}

std::vector<KeyFrameId> EdgeMapper::latest(int count) const {
  std::vector<KeyFrameId> mapped;
  std::size_t begun_with = 0;
  {
    std::lock_guard lock(mutex_);
    mapped = mapped_keyframes_;
    begun_with = begun_with_;
  }
  return map_->read([&](const MapView& view) {
    std::vector<KeyFrameId> found;
    for (std::size_t i = mapped.size(); i > 0 && std::ssize(found) < count; --i) {
      if (i == begun_with && !found.empty()) {
        add_covisibles(view, count, found);
        break;
      }
      if (view.keyframe(mapped[i - 1])) found.push_back(mapped[i - 1]);
    }
    return found;
  });
}

KeyFrameId EdgeMapper::newest() const {
  std::lock_guard lock(mutex_);
  return mapped_keyframes_.empty() ? KeyFrameId{} : mapped_keyframes_.back();
}

KeyFrameId EdgeMapper::newest_past_probation() const {
  std::lock_guard lock(mutex_);
  const auto mapped = std::ssize(mapped_keyframes_);
  const auto place = mapped - 1 - LocalMapper::kProbationKeyFrames;
  return place < 0 ? KeyFrameId{} : mapped_keyframes_[static_cast<std::size_t>(place)];
}

void EdgeMapper::drain(Worker& worker, RunTime deadline) {
  mapping_.drained().wait(worker);
  if (loops_ && !loops_->drained().wait(worker, deadline)) loops_->cancel();
}

CommitReport EdgeMapper::merge(Worker& worker, MapDelta changes) {
  mapping_.reset(map_).wait(worker);  // mapping is parked, so nothing else changes the map now
  {
    std::lock_guard lock(mutex_);
    std::erase_if(admitted_, [this](KeyFrameId id) { return pending_.contains(id); });
    pending_.clear();
  }
  changes = map_->read([&](const MapView& view) { return rebase_changes(view, changes); });
  const CommitReport report = map_->commit(changes);
  corrections_.forget();
  {
    std::lock_guard lock(mutex_);
    for (const NewKeyFrame& keyframe : changes.keyframes) {
      admitted_.push_back(keyframe.id);
      mapped_keyframes_.push_back(keyframe.id);
      last_admitted_s_ = std::max(last_admitted_s_, keyframe.timestamp_s);
    }
  }
  places_->update_from(*map_);
  mapping_.reset(map_).wait(worker);  // tells the mapper which ids are taken
  return report;
}

}  // namespace slambed
