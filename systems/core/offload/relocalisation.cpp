// SPDX-License-Identifier: Apache-2.0
#include "offload/relocalisation.hpp"

#include <algorithm>

#include "offload/update_content.hpp"
#include "wire/message_type.hpp"

namespace slambed {

void RelocalisationRequests::after_frame(Worker& worker, const TrackedFrame& frame) {
  if (frame.outcome.state != TrackingState::kLost) {
    last_ = RunTime::min();
    return;
  }
  const RunTime now = worker.now();
  if (last_ != RunTime::min() && now - last_ < period_) return;
  last_ = now;
  channel_.send(
      static_cast<std::uint8_t>(wire::MessageType::kFrame),
      codec_.serialise(worker, wire::FrameMessage{.frame_index = frame.offered.played.index,
                                                  .timestamp_s = frame.offered.played.seq_s(),
                                                  .features = frame.features}));
}

RelocalisationService::RelocalisationService(EdgeNode& node, EdgeMapping& mapping, Channel& frames,
                                             int update_keyframes, RelocalisationOptions options)
    : node_(node),
      mapping_(mapping),
      channel_(frames),
      update_keyframes_(update_keyframes),
      options_(options),
      places_(mapping.places()) {
  mapping_.on_mapped([this](Worker&, KeyFrameId) { places_->follow(*mapping_.map()); });
}

void RelocalisationService::start() {
  node_.runtime().spawn("reloc", [this](Worker& worker) { serve(worker); });
}

void RelocalisationService::serve(Worker& worker) {
  RunTime last_map = RunTime::min();
  while (const auto message = channel_.receive(worker, kNever)) {
    if (message->type != static_cast<std::uint8_t>(wire::MessageType::kFrame)) continue;
    // The mobile has just sent the newest of its frames; older maps would come too late for it.
    if (last_map != RunTime::min() && worker.now() - last_map < options_.map_period) continue;
    std::vector<KeyFrameId> found;
    const bool parsed = worker.stage(options_.codec.parse_stage(), [&](StageUnits& units) {
      units.n1 = kilobytes(message->payload);
      try {
        found = find(options_.codec.frame(message->payload, node_.peer().sensor()));
        return true;
      } catch (const wire::DecodeError& error) {
        node_.log().warning(std::string("FRAME refused: ") + error.what());
        return false;
      }
    });
    const auto latest = mapping_.latest(update_keyframes_);
    if (!parsed || found.empty() || latest.empty()) continue;
    const KeyFrameId newest = latest.front();
    for (const KeyFrameId id : latest) {
      if (std::find(found.begin(), found.end(), id) == found.end()) found.push_back(id);
    }
    last_map = worker.now();
    const wire::UpdateTimes times{.captured = message->queued,
                                  .queued = message->queued,
                                  .received = message->received,
                                  .accepted = last_map,
                                  .mapped = last_map,
                                  .due = last_map};
    mapping_.send_update(worker, times, newest, found, true);
  }
}

std::vector<KeyFrameId> RelocalisationService::find(const wire::FrameMessage& frame) {
  const auto bag = places_->vocabulary().transform(frame.features->descriptors());
  return mapping_.map()->read([&](const MapView& view) {
    auto found = places_->candidates(bag, view);
    std::erase_if(found, [&](KeyFrameId id) { return view.keyframe(id) == nullptr; });
    if (std::ssize(found) > options_.max_candidates) {
      found.resize(static_cast<std::size_t>(options_.max_candidates));
    }
    return with_covisibles(view, std::move(found), options_.covisibles);
  });
}

}  // namespace slambed
