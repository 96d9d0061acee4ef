// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/feature_chains.hpp"

#include <algorithm>

namespace slambed::edgeslam_semantic {

std::span<const ChainId> FeatureChains::follow(const FeatureSet& features) {
  ++frame_;
  struct Holder {
    int chain = -1, distance = 257;
  };
  std::vector<Holder> holders(static_cast<std::size_t>(features.size()));
  for (std::size_t c = 0; c < chains_.size(); ++c) {
    const Chain& chain = chains_[c];
    const auto steps = static_cast<float>(frame_ - chain.seen);
    Matcher::Query query;
    query.at.u = chain.u + steps * chain.du;
    query.at.v = chain.v + steps * chain.dv;
    query.radius_px = options_.radius_px;
    query.min_octave = chain.octave - 1;
    query.max_octave = chain.octave + 1;
    query.descriptor = &chain.descriptor;
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
    const int chain = holders[static_cast<std::size_t>(i)].chain;
    if (chain >= 0)
      rotation_.add(chains_[static_cast<std::size_t>(chain)].angle_deg,
                    features.keypoint(i).angle_deg, i);
  }
  for (const int i : rotation_.disagreeing()) holders[static_cast<std::size_t>(i)].chain = -1;

  ids_.assign(holders.size(), 0);
  std::vector<Chain> seen;
  seen.reserve(chains_.size() + holders.size());
  for (int i = 0; i < features.size(); ++i) {
    const KeyPoint& at = features.keypoint(i);
    const int before = holders[static_cast<std::size_t>(i)].chain;
    Chain chain{.u = at.u, .v = at.v, .angle_deg = at.angle_deg};
    chain.descriptor = features.descriptor(i);
    chain.octave = at.octave;
    chain.seen = frame_;
    if (before >= 0) {
      Chain& old = chains_[static_cast<std::size_t>(before)];
      const auto steps = static_cast<float>(frame_ - old.seen);
      chain.id = old.id;
      chain.du = (at.u - old.u) / steps;
      chain.dv = (at.v - old.v) / steps;
      old.id = 0;  // goes on here
    } else {
      chain.id = next_++;
    }
    ids_[static_cast<std::size_t>(i)] = chain.id;
    seen.push_back(chain);
  }
  for (const Chain& chain : chains_)
    if (chain.id != 0 && frame_ - chain.seen <= options_.missing_frames) seen.push_back(chain);
  chains_ = std::move(seen);
  return ids_;
}

int FeatureChains::shared(const std::unordered_set<ChainId>& chains) const {
  return static_cast<int>(std::count_if(ids_.begin(), ids_.end(),
                                        [&](ChainId chain) { return chains.contains(chain); }));
}

}  // namespace slambed::edgeslam_semantic
