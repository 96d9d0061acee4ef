// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <shared_mutex>
#include <span>
#include <vector>

#include "base/ids.hpp"
#include "features/vocabulary.hpp"
#include "map/map.hpp"
#include "map/slot_table.hpp"

namespace slambed {

/// Which keyframes look like this image? An inverted file from visual words to keyframes, with
/// ORB-SLAM2's rules for choosing among them (its KeyFrameDatabase). May be shared between threads:
/// tracking asks while loop closing adds. Its lock is taken after a map's, never before.
class PlaceIndex {
 public:
  using Bag = std::shared_ptr<const BagOfWords>;

  explicit PlaceIndex(std::shared_ptr<const Vocabulary> vocabulary);

  const Vocabulary& vocabulary() const { return *vocabulary_; }
  /// Takes in the keyframes of a map that are missing here and drops those it does not have; costs
  /// what changed since the last call. Of two calls at a time the one that saw less may end last:
  /// the next call makes up for it.
  void update_from(const Map& map);
  void add(KeyFrameId keyframe, BagOfWords bag);
  void remove(KeyFrameId keyframe);
  void clear();
  std::size_t size() const;
  /// Null for a keyframe that is not here.
  Bag bag(KeyFrameId keyframe) const;

  /// Keyframes that may show the place of a lost frame, best group first. The map is read for their
  /// groups alone: the search, which takes longer the larger the map is, keeps nobody out of it.
  std::vector<KeyFrameId> candidates(const BagOfWords& bag, const Map& map) const;
  /// The same for a loop: without the keyframes in exclude (ascending), at least min_score similar.
  std::vector<KeyFrameId> candidates(const BagOfWords& bag, const Map& map,
                                     std::span<const KeyFrameId> exclude, double min_score) const;

 private:
  struct Entry {
    KeyFrameId keyframe;
    Bag bag;  ///< null where free
  };
  /// A keyframe has a word, with this weight in its bag.
  struct Posting {
    std::uint32_t slot;
    float weight;
  };
  /// Place in entries_ plus one; 0 for a keyframe that is not here.
  using SlotNumber = std::uint32_t;
  /// How far into which map's journal we have followed.
  struct Followed {
    std::shared_ptr<const std::byte> generation;
    std::size_t changes = 0;
  };

  static std::vector<Posting>::iterator place_of(std::uint32_t slot, std::vector<Posting>& list);
  const Entry* find(KeyFrameId keyframe) const;
  void insert(KeyFrameId keyframe, Bag bag);
  void erase(KeyFrameId keyframe);
  using Scores = std::vector<std::pair<KeyFrameId, double>>;  ///< ascending by keyframe
  Scores similar(const BagOfWords& bag, std::span<const KeyFrameId> exclude,
                 double min_score) const;
  static std::vector<KeyFrameId> best_of_groups(const Scores& scores, const MapView& map);

  std::shared_ptr<const Vocabulary> vocabulary_;
  mutable std::shared_mutex mutex_;
  SlotTable<KeyFrameId, SlotNumber> slots_;
  std::vector<Entry> entries_;
  std::vector<std::uint32_t> free_;             ///< slots
  std::vector<std::vector<Posting>> postings_;  ///< per word, slots ascending
  Followed followed_;
};

}  // namespace slambed
