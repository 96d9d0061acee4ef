// SPDX-License-Identifier: Apache-2.0
#include "features/vocabulary.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "features/descriptor_distance.hpp"

namespace slambed {
namespace {

/// Features are matched only within nodes of this level, about a hundred groups (ORB-SLAM2).
constexpr int kMatchingLevel = 2;
constexpr std::uint32_t kChildrenAtOnce = 16;

}  // namespace

double similarity(const BagOfWords& a, const BagOfWords& b) {
  double sum = 0;
  auto i = a.words.begin();
  auto j = b.words.begin();
  while (i != a.words.end() && j != b.words.end()) {
    if (i->first < j->first) {
      ++i;
    } else if (j->first < i->first) {
      ++j;
    } else {
      sum += std::min(i->second, j->second);
      ++i, ++j;
    }
  }
  return sum;  // 1 - |a - b|/2 for L1-normalized vectors
}

int Vocabulary::matching_level() const { return std::min(kMatchingLevel, depth_); }

std::pair<const Vocabulary::Node*, std::uint32_t> Vocabulary::find(
    const Descriptor& descriptor) const {
  const DistanceKernels& kernels = descriptor_distance();
  std::array<const Descriptor*, kChildrenAtOnce> some;
  std::array<std::uint16_t, kChildrenAtOnce> distances;
  std::uint32_t index = 0, passed = 0;
  while (nodes_[index].children > 0) {
    const std::uint32_t begin = nodes_[index].first_child, end = begin + nodes_[index].children;
    int best_distance = 257;
    for (std::uint32_t first = begin; first < end; first += kChildrenAtOnce) {
      const std::uint32_t n = std::min(end - first, kChildrenAtOnce);
      for (std::uint32_t i = 0; i < n; ++i) some[i] = &nodes_[first + i].descriptor;
      kernels.to_each(descriptor, {some.data(), n}, distances.data());
      for (std::uint32_t i = 0; i < n; ++i)
        if (distances[i] < best_distance) best_distance = distances[i], index = first + i;
    }
    if (nodes_[index].level <= matching_level()) passed = index;
  }
  return {&nodes_[index], passed};
}

BagOfWords Vocabulary::transform(std::span<const Descriptor> descriptors) const {
  BagOfWords bag;
  std::vector<std::pair<std::uint32_t, std::uint16_t>> by_node;
  by_node.reserve(descriptors.size());
  for (std::size_t i = 0; i < descriptors.size(); ++i) {
    const auto [leaf, node] = find(descriptors[i]);
    if (leaf->weight <= 0) continue;  // the word was in every training image
    bag.words.emplace_back(leaf->word, leaf->weight);
    by_node.emplace_back(node, static_cast<std::uint16_t>(i));
  }
  std::sort(bag.words.begin(), bag.words.end());
  std::size_t kept = 0;
  double total = 0;
  for (std::size_t i = 0; i < bag.words.size(); ++i) {
    total += bag.words[i].second;
    if (kept > 0 && bag.words[kept - 1].first == bag.words[i].first) {
      bag.words[kept - 1].second += bag.words[i].second;
    } else {
      bag.words[kept++] = bag.words[i];
    }
  }
  bag.words.resize(kept);
  for (auto& word : bag.words) word.second = static_cast<float>(word.second / total);

  std::sort(by_node.begin(), by_node.end());
  for (const auto& [node, feature] : by_node) {
    if (bag.nodes.empty() || bag.nodes.back().first != node) {
      bag.nodes.emplace_back(node, std::vector<std::uint16_t>());
    }
    bag.nodes.back().second.push_back(feature);
  }
  return bag;
}

}  // namespace slambed
