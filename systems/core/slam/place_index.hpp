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

/// Finds keyframes that look like an image: an inverted file from visual words to keyframes with
/// the selection rules of ORB-SLAM2's KeyFrameDatabase. Thread-safe: tracking queries while loop
/// closing adds. Lock order: the map's lock before the index's, never the other way round.
class PlaceIndex {
 public:
  using Bag = std::shared_ptr<const BagOfWords>;

  explicit PlaceIndex(std::shared_ptr<const Vocabulary> vocabulary);

  const Vocabulary& vocabulary() const { return *vocabulary_; }
  /// Adds the map's keyframes that are missing here and removes those that the map lacks. Its cost
  /// depends on what changed since the last call. If two calls overlap, the one with the older view
  /// may end last; the next call corrects that.
  void update_from(const Map& map);
  void add(KeyFrameId keyframe, BagOfWords bag);
  void remove(KeyFrameId keyframe);
  void clear();
  std::size_t size() const;
  /// Null for an unknown keyframe.
  Bag bag(KeyFrameId keyframe) const;

  /// Returns keyframes that may show the place of a lost frame, best group first. Reads the map
  /// only to group them: the search, whose time grows with the map, holds no map lock.
  std::vector<KeyFrameId> candidates(const BagOfWords& bag, const Map& map) const;
  /// The same for a loop: only keyframes outside exclude with a similarity of min_score or more.
  std::vector<KeyFrameId> candidates(const BagOfWords& bag, const Map& map,
                                     std::span<const KeyFrameId> exclude, double min_score) const;

 private:
  struct Entry {
    KeyFrameId keyframe;
    Bag bag;  ///< null where free
  };
  /// A keyframe that has the word, and the word's weight in its bag.
  struct Posting {
    std::uint32_t slot;
    float weight;
  };
  /// Index into entries_ plus one; 0 for an unknown keyframe.
  using SlotNumber = std::uint32_t;
  /// How much of which map's journal has been read.
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
