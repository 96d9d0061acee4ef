// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "features/feature_set.hpp"
#include "features/vocabulary.hpp"

namespace slambed {

/// One image for the search by words: only features marked in `wanted` take part; an empty list
/// means all.
struct WordView {
  const FeatureSet& features;
  const BagOfWords& bag;
  std::span<const std::uint8_t> wanted;
};

/// Matches features of two images inside the vocabulary nodes that both have: distance at most
/// kHammingLow, best / second below ratio, each feature once, rotation check. Returns pairs
/// (feature of a, feature of b), ascending by the second.
std::vector<std::pair<int, int>> match_by_words(const WordView& a, const WordView& b, float ratio);

}  // namespace slambed
