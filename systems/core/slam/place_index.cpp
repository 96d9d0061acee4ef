// SPDX-License-Identifier: Apache-2.0
#include "slam/place_index.hpp"

#include <algorithm>
#include <mutex>

namespace slambed {
namespace {

/// A candidate must share more than this fraction of the words that the best one shares.
constexpr double kCommonWordShare = 0.8;
/// A group of covisible candidates must exceed this fraction of the best group's score.
constexpr double kGroupScoreShare = 0.75;
constexpr std::size_t kGroupNeighbors = 10;

/// Posting lists are short and scattered in memory, so this many are prefetched ahead.
constexpr std::size_t kListsAhead = 4;
constexpr std::size_t kCacheLine_bytes = 64;

template <typename Item>
void fetch(const std::vector<Item>& list) {
  for (std::size_t i = 0; i < list.size(); i += kCacheLine_bytes / sizeof(Item))
    __builtin_prefetch(&list[i]);
}

struct Group {
  KeyFrameId best;
  double score = 0;
};

}  // namespace

PlaceIndex::PlaceIndex(std::shared_ptr<const Vocabulary> vocabulary)
    : vocabulary_(std::move(vocabulary)), postings_(vocabulary_->words()) {}

std::vector<PlaceIndex::Posting>::iterator PlaceIndex::place_of(std::uint32_t slot,
                                                                std::vector<Posting>& list) {
  return std::lower_bound(
      list.begin(), list.end(), slot,
      [](const Posting& posting, std::uint32_t wanted) { return posting.slot < wanted; });
}

const PlaceIndex::Entry* PlaceIndex::find(KeyFrameId keyframe) const {
  const SlotNumber* number = slots_.find(keyframe);
  return number && *number > 0 ? &entries_[*number - 1] : nullptr;
}

void PlaceIndex::insert(KeyFrameId keyframe, Bag bag) {
  SlotNumber* number = slots_.make(keyframe);
  if (!number) return;
  if (*number > 0) erase(keyframe);
  std::uint32_t slot = static_cast<std::uint32_t>(entries_.size());
  if (free_.empty()) {
    entries_.emplace_back();
  } else {
    slot = free_.back();
    free_.pop_back();
  }
  for (const auto& [word, weight] : bag->words) {
    auto& list = postings_[word];
    list.insert(place_of(slot, list), {slot, weight});
  }
  entries_[slot] = {keyframe, std::move(bag)};
  *number = slot + 1;
}

void PlaceIndex::erase(KeyFrameId keyframe) {
  SlotNumber* number = slots_.find(keyframe);
  if (!number || *number == 0) return;
  const std::uint32_t slot = *number - 1;
  for (const auto& [word, weight] : entries_[slot].bag->words) {
    auto& list = postings_[word];
    list.erase(place_of(slot, list));
  }
  entries_[slot] = {};
  free_.push_back(slot);
  *number = 0;
}

void PlaceIndex::update_from(const Map& map) {
  std::vector<KeyFrameId> gone;
  std::vector<std::pair<KeyFrameId, std::shared_ptr<const FeatureSet>>> fresh;
  const Followed now = map.read([&](const MapView& view) {
    const KeyFrameJournal& journal = view.keyframe_journal();
    std::shared_lock lock(mutex_);
    const bool further = followed_.generation == journal.generation;
    if (!further)
      for (const Entry& entry : entries_)
        if (entry.bag && !view.keyframe(entry.keyframe)) gone.push_back(entry.keyframe);
    for (std::size_t i = further ? followed_.changes : 0; i < journal.changes.size(); ++i) {
      const KeyFrameId id = journal.changes[i];
      const KeyFrame* keyframe = view.keyframe(id);
      if (!keyframe)
        gone.push_back(id);
      else if (!find(id))
        fresh.emplace_back(id, keyframe->features);
    }
    return Followed{journal.generation, journal.changes.size()};
  });
  std::vector<Bag> bags;
  for (const auto& [id, features] : fresh)
    bags.push_back(
        std::make_shared<const BagOfWords>(vocabulary_->transform(features->descriptors())));
  std::unique_lock lock(mutex_);
  for (std::size_t i = 0; i < fresh.size(); ++i) insert(fresh[i].first, std::move(bags[i]));
  for (const KeyFrameId id : gone) erase(id);
  followed_ = now;
}

void PlaceIndex::add(KeyFrameId keyframe, BagOfWords bag) {
  auto shared = std::make_shared<const BagOfWords>(std::move(bag));
  std::unique_lock lock(mutex_);
  insert(keyframe, std::move(shared));
  followed_ = {};
}

void PlaceIndex::remove(KeyFrameId keyframe) {
  std::unique_lock lock(mutex_);
  erase(keyframe);
  followed_ = {};
}

void PlaceIndex::clear() {
  std::unique_lock lock(mutex_);
  slots_.clear();
  entries_.clear();
  free_.clear();
  for (auto& list : postings_) list.clear();
  followed_ = {};
}

std::size_t PlaceIndex::size() const {
  std::shared_lock lock(mutex_);
  return entries_.size() - free_.size();
}

PlaceIndex::Bag PlaceIndex::bag(KeyFrameId keyframe) const {
  std::shared_lock lock(mutex_);
  const Entry* entry = find(keyframe);
  return entry ? entry->bag : nullptr;
}

/// Returns keyframes that share many words with the bag and are similar enough, ascending, with
/// their similarity. One pass over the postings counts the words and sums the similarity.
PlaceIndex::Scores PlaceIndex::similar(const BagOfWords& bag, std::span<const KeyFrameId> exclude,
                                       double min_score) const {
  struct Shared {
    double score = 0;
    int words = 0;
  };
  std::shared_lock lock(mutex_);
  std::vector<Shared> shared(entries_.size());
  for (std::size_t i = 0; i < bag.words.size(); ++i) {
    if (i + kListsAhead < bag.words.size()) fetch(postings_[bag.words[i + kListsAhead].first]);
    const auto& [word, weight] = bag.words[i];
    for (const Posting& posting : postings_[word]) {
      Shared& with = shared[posting.slot];
      ++with.words;
      with.score += std::min(weight, posting.weight);
    }
  }
  for (const KeyFrameId id : exclude)
    if (const Entry* entry = find(id)) shared[entry - entries_.data()] = {};
  int most = 0;
  for (const Shared& with : shared) most = std::max(most, with.words);

  Scores scores;
  for (std::size_t slot = 0; slot < shared.size(); ++slot) {
    const Shared& with = shared[slot];
    if (with.words > kCommonWordShare * most && with.score >= min_score)
      scores.emplace_back(entries_[slot].keyframe, with.score);
  }
  std::sort(scores.begin(), scores.end());
  return scores;
}

std::vector<KeyFrameId> PlaceIndex::candidates(const BagOfWords& bag, const Map& map) const {
  return candidates(bag, map, {}, 0);
}

std::vector<KeyFrameId> PlaceIndex::candidates(const BagOfWords& bag, const Map& map,
                                               std::span<const KeyFrameId> exclude,
                                               double min_score) const {
  const Scores scores = similar(bag, exclude, min_score);
  return map.read([&](const MapView& view) { return best_of_groups(scores, view); });
}

std::vector<KeyFrameId> PlaceIndex::best_of_groups(const Scores& scores, const MapView& map) {
  std::vector<Group> groups;
  double best_group = 0;
  for (const auto& [id, score] : scores) {
    const KeyFrame* keyframe = map.keyframe(id);
    if (!keyframe) continue;
    Group group{id, score};
    double best_score = score;
    const auto& covisibles = keyframe->covisibles;
    for (std::size_t i = 0; i < std::min(kGroupNeighbors, covisibles.size()); ++i) {
      const auto neighbor = std::lower_bound(
          scores.begin(), scores.end(), covisibles[i].id,
          [](const auto& entry, KeyFrameId wanted) { return entry.first < wanted; });
      if (neighbor == scores.end() || neighbor->first != covisibles[i].id) continue;
      group.score += neighbor->second;
      if (neighbor->second > best_score) {
        best_score = neighbor->second;
        group.best = neighbor->first;
      }
    }
    best_group = std::max(best_group, group.score);
    groups.push_back(group);
  }
  std::stable_sort(groups.begin(), groups.end(),
                   [](const Group& a, const Group& b) { return a.score > b.score; });
  std::vector<KeyFrameId> chosen;
  for (const Group& group : groups) {
    if (group.score <= kGroupScoreShare * best_group && group.score < best_group) break;
    if (std::find(chosen.begin(), chosen.end(), group.best) == chosen.end())
      chosen.push_back(group.best);
  }
  return chosen;
}

}  // namespace slambed
