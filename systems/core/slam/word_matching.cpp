// SPDX-License-Identifier: Apache-2.0
#include "slam/word_matching.hpp"

#include "features/descriptor_distance.hpp"
#include "slam/matching.hpp"

namespace slambed {
namespace {

struct Holder {
  int feature = -1;
  int distance = 257;
};

bool wanted(const WordView& view, int feature) {
  return view.wanted.empty() || view.wanted[static_cast<std::size_t>(feature)];
}

/// Matches each wanted feature of a with those of b in one node; the closer one keeps a feature.
void match_node(const WordView& a, std::span<const std::uint16_t> of_a, const WordView& b,
                std::span<const int> of_b, float ratio, std::vector<std::uint16_t>& distances,
                std::vector<Holder>& holder) {
  distances.resize(of_b.size());
  for (const int i : of_a) {
    if (!wanted(a, i)) continue;
    descriptor_distance().to_some(a.features.descriptor(i), b.features.descriptors().data(), of_b,
                                  distances.data());
    int best = -1, best_distance = 257, second_distance = 257;
    for (std::size_t k = 0; k < of_b.size(); ++k) {
      if (distances[k] < best_distance) {
        second_distance = best_distance;
        best_distance = distances[k];
        best = of_b[k];
      } else if (distances[k] < second_distance) {
        second_distance = distances[k];
      }
    }
    if (best < 0 || best_distance > kHammingLow ||
        static_cast<float>(best_distance) >= ratio * static_cast<float>(second_distance))
      continue;
    if (best_distance < holder[best].distance) holder[best] = {i, best_distance};
  }
}

}  // namespace

std::vector<std::pair<int, int>> match_by_words(const WordView& a, const WordView& b, float ratio) {
  std::vector<Holder> holder(static_cast<std::size_t>(b.features.size()));
  std::vector<std::uint16_t> distances;
  std::vector<int> of_b;
  auto at_a = a.bag.nodes.begin();
  auto at_b = b.bag.nodes.begin();
  while (at_a != a.bag.nodes.end() && at_b != b.bag.nodes.end()) {
    if (at_a->first < at_b->first) {
      ++at_a;
    } else if (at_b->first < at_a->first) {
      ++at_b;
    } else {
      of_b.clear();
      for (const int feature : at_b->second)
        if (wanted(b, feature)) of_b.push_back(feature);
      match_node(a, at_a->second, b, of_b, ratio, distances, holder);
      ++at_a, ++at_b;
    }
  }
  RotationCheck rotation;
  for (int i = 0; i < b.features.size(); ++i)
    if (holder[i].feature >= 0)
      rotation.add(a.features.keypoint(holder[i].feature).angle_deg,
                   b.features.keypoint(i).angle_deg, i);
  for (const int i : rotation.disagreeing()) holder[i].feature = -1;
  std::vector<std::pair<int, int>> matches;
  for (int i = 0; i < b.features.size(); ++i)
    if (holder[i].feature >= 0) matches.emplace_back(holder[i].feature, i);
  return matches;
}

}  // namespace slambed
