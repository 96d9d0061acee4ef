// SPDX-License-Identifier: Apache-2.0
#include "offload/relocalisation_by_map.hpp"

#include <algorithm>

#include "offload/update_content.hpp"

namespace slambed {

RelocalisationHelp::Answer RelocalisationByMap::find(const Message& raw,
                                                     const wire::FrameMessage& frame) {
  auto found = alike(frame);
  if (found.empty()) return {};
  return [this, queued = raw.queued, received = raw.received, found = std::move(found)](
             Worker& worker) { return send(worker, queued, received, found); };
}

std::vector<KeyFrameId> RelocalisationByMap::alike(const wire::FrameMessage& frame) const {
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

bool RelocalisationByMap::send(Worker& worker, RunTime queued, RunTime received,
                               std::vector<KeyFrameId> found) {
  const auto latest = mapper_.latest(latest_);
  if (latest.empty()) return false;
  for (const KeyFrameId id : latest) {
    if (std::find(found.begin(), found.end(), id) == found.end()) found.push_back(id);
  }
  const RunTime now = worker.now();
  const wire::UpdateTimes times{.captured = queued,
                                .queued = queued,
                                .received = received,
                                .accepted = now,
                                .mapped = now,
                                .due = now};
  updates_.send(worker, times, latest.front(), found, true);
  return true;
}

}  // namespace slambed
