// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/feature_tracks.hpp"

#include <algorithm>

namespace slambed::edgeslam_semantic {

std::span<const FeatureTrackId> FeatureTracks::track(const FeatureSet& features, double time_s) {
  ++frame_;
  const float radius_px = options_.radius_px_per_s * static_cast<float>(time_s - time_s_);
  time_s_ = time_s;
  struct Holder {
    int track = -1, distance = 257;
  };
  std::vector<Holder> holders(static_cast<std::size_t>(features.size()));
  for (std::size_t c = 0; c < tracks_.size(); ++c) {
    const Track& track = tracks_[c];
    const auto since_s = static_cast<float>(time_s - track.seen_s);
    Matcher::Query query;
    query.at.u = track.u + since_s * track.du;
    query.at.v = track.v + since_s * track.dv;
    query.radius_px = radius_px;
    query.min_octave = track.octave - 1;
    query.max_octave = track.octave + 1;
    query.descriptor = &track.descriptor;
    const auto best = matcher_.search(features, query, [](int) { return true; });
    if (best.feature < 0 || best.distance > kHammingLow) continue;
    if (static_cast<float>(best.distance) >=
        options_.ratio * static_cast<float>(best.second_distance))
      continue;
    Holder& holder = holders[static_cast<std::size_t>(best.feature)];
    if (best.distance < holder.distance) holder = {static_cast<int>(c), best.distance};
  }
  rotation_.clear();
  for (int i = 0; i < features.size(); ++i) {
    const int track = holders[static_cast<std::size_t>(i)].track;
    if (track >= 0)
      rotation_.add(tracks_[static_cast<std::size_t>(track)].angle_deg,
                    features.keypoint(i).angle_deg, i);
  }
  for (const int i : rotation_.disagreeing()) holders[static_cast<std::size_t>(i)].track = -1;

  ids_.assign(holders.size(), 0);
  std::vector<Track> seen;
  seen.reserve(tracks_.size() + holders.size());
  for (int i = 0; i < features.size(); ++i) {
    const KeyPoint& at = features.keypoint(i);
    const int before = holders[static_cast<std::size_t>(i)].track;
    Track track{.u = at.u, .v = at.v, .angle_deg = at.angle_deg};
    track.descriptor = features.descriptor(i);
    track.octave = at.octave;
    track.seen = frame_;
    track.seen_s = time_s;
    if (before >= 0) {
      Track& old = tracks_[static_cast<std::size_t>(before)];
      const auto since_s = static_cast<float>(time_s - old.seen_s);
      track.id = old.id;
      track.du = (at.u - old.u) / since_s;
      track.dv = (at.v - old.v) / since_s;
      old.id = 0;  // its successor replaces it
    } else {
      track.id = next_++;
    }
    ids_[static_cast<std::size_t>(i)] = track.id;
    seen.push_back(track);
  }
  for (const Track& track : tracks_)
    if (track.id != 0 && frame_ - track.seen <= options_.missing_frames) seen.push_back(track);
  tracks_ = std::move(seen);
  return ids_;
}

int FeatureTracks::shared(const std::unordered_set<FeatureTrackId>& tracks) const {
  return static_cast<int>(std::count_if(
      ids_.begin(), ids_.end(), [&](FeatureTrackId track) { return tracks.contains(track); }));
}

}  // namespace slambed::edgeslam_semantic
