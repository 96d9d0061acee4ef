// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <shared_mutex>
#include <span>
#include <vector>

#include "base/ids.hpp"
#include "features/vocabulary.hpp"
#include "map/map.hpp"

namespace slambed {

/// Which keyframes look like this image? An inverted file from visual words to keyframes, with
/// ORB-SLAM2's rules for choosing among them (docs/slam.md). May be shared between threads:
/// tracking asks while loop closing adds. Its lock is taken after a map's, never before.
class PlaceIndex {
 public:
  using Bag = std::shared_ptr<const BagOfWords>;

  explicit PlaceIndex(std::shared_ptr<const Vocabulary> vocabulary);

  const Vocabulary& vocabulary() const { return *vocabulary_; }
  /// Takes in the keyframes of a map that are missing here and drops those it does not have.
  void follow(const Map& map);
  void add(KeyFrameId keyframe, BagOfWords bag);
  void remove(KeyFrameId keyframe);
  void clear();
  std::size_t size() const;
  /// Null for a keyframe that is not here.
  Bag bag(KeyFrameId keyframe) const;

  /// Keyframes that may show the place of a lost frame, best group first.
  std::vector<KeyFrameId> candidates(const BagOfWords& bag, const MapView& map) const;
  /// The same for a loop: without the keyframes in exclude (ascending), at least min_score similar.
  std::vector<KeyFrameId> candidates(const BagOfWords& bag, const MapView& map,
                                     std::span<const KeyFrameId> exclude, double min_score) const;

 private:
  void insert(KeyFrameId keyframe, Bag bag);
  void erase(KeyFrameId keyframe);
  std::vector<std::pair<KeyFrameId, double>> similar(const BagOfWords& bag,
                                                     std::span<const KeyFrameId> exclude,
                                                     double min_score) const;

  std::shared_ptr<const Vocabulary> vocabulary_;
  mutable std::shared_mutex mutex_;
  std::map<KeyFrameId, std::uint32_t> slots_;
  std::vector<Bag> bags_;            ///< by slot; null where free
  std::vector<std::uint32_t> free_;  ///< slots
  std::vector<std::vector<std::uint32_t>> slots_of_word_;
};

}  // namespace slambed
