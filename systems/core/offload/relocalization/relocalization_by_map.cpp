// SPDX-License-Identifier: Apache-2.0
#include "offload/relocalization/relocalization_by_map.hpp"

#include <algorithm>

#include "node/messaging.hpp"
#include "offload/maps/update_content.hpp"

namespace slambed {

void MobileRelocalizationByMap::after_frame(Worker& worker, const TrackedFrame& frame) {
  if (frame.outcome.state != TrackingState::kLost) {
    last_ = RunTime::min();
    return;
  }
  const RunTime now = worker.now();
  if (last_ != RunTime::min() && now - last_ < period_) return;
  last_ = now;
  send(channel_, wire::FrameMessage::kType,
       codec_.serialize(worker, wire::FrameMessage{.frame_index = frame.offered.played.index,
                                                   .timestamp_s = frame.offered.played.seq_s(),
                                                   .features = frame.features}));
}

void EdgeRelocalizationByMap::start() {
  node_.runtime().spawn("reloc", [this](Worker& worker) { serve(worker); });
}

void EdgeRelocalizationByMap::serve(Worker& worker) {
  RunTime last = RunTime::min();
  while (const auto message = channel_.receive(worker, kNever)) {
    if (!is(*message, wire::FrameMessage::kType)) continue;
    updates_.suspend(message->queued);
    // Skipped, not delayed: the mobile sends newer frames, and a late answer would be useless.
    if (last != RunTime::min() && worker.now() - last < options_.period) continue;
    auto found = worker.stage(options_.codec.parse_stage(), [&](StageUnits& units) {
      units.n1 = kilobytes(message->payload);
      const auto frame = read(node_.log(), *message, [&](const Bytes& bytes) {
        return options_.codec.frame(worker, bytes, node_.peer().sensor());
      });
      return frame ? alike(*frame) : std::vector<KeyFrameId>();
    });
    if (found.empty()) continue;
    const RunTime when = worker.now();
    if (send(worker, *message, std::move(found))) last = when;
  }
}

std::vector<KeyFrameId> EdgeRelocalizationByMap::alike(const wire::FrameMessage& frame) const {
  const PlaceIndex& places = *mapper_.places();
  const auto bag = places.vocabulary().transform(frame.features->descriptors());
  auto found = places.candidates(bag, *mapper_.map());
  return mapper_.map()->read([&](const MapView& view) {
    std::erase_if(found, [&](KeyFrameId id) { return view.keyframe(id) == nullptr; });
    if (std::ssize(found) > options_.max_candidates) {
      found.resize(static_cast<std::size_t>(options_.max_candidates));
    }
    return with_covisibles(view, std::move(found), options_.covisibles);
  });
}

bool EdgeRelocalizationByMap::send(Worker& worker, const Message& raw,
                                   std::vector<KeyFrameId> found) {
  const auto latest = mapper_.latest(options_.latest);
  if (latest.empty()) return false;
  for (const KeyFrameId id : latest) {
    if (std::find(found.begin(), found.end(), id) == found.end()) found.push_back(id);
  }
  const RunTime now = worker.now();
  const wire::UpdateTimes times{.captured = raw.queued,
                                .queued = raw.queued,
                                .received = raw.received,
                                .accepted = now,
                                .mapped = now,
                                .due = now};
  updates_.send(worker, times, latest.front(), found, true);
  return true;
}

}  // namespace slambed
