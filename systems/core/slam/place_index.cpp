// SPDX-License-Identifier: Apache-2.0
#include "slam/place_index.hpp"

#include <algorithm>
#include <mutex>

namespace slambed {
namespace {

/// A candidate shares more than this part of the words that the best one shares.
constexpr double kCommonWordShare = 0.8;
/// A group of covisible candidates counts when it reaches this part of the best group's score.
constexpr double kGroupScoreShare = 0.75;
constexpr std::size_t kGroupNeighbours = 10;

struct Group {
  KeyFrameId best;
  double score = 0;
};

}  // namespace

PlaceIndex::PlaceIndex(std::shared_ptr<const Vocabulary> vocabulary)
    : vocabulary_(std::move(vocabulary)), slots_of_word_(vocabulary_->words()) {}

void PlaceIndex::insert(KeyFrameId keyframe, Bag bag) {
  erase(keyframe);
  std::uint32_t slot = static_cast<std::uint32_t>(bags_.size());
  if (free_.empty()) {
    bags_.emplace_back();
  } else {
    slot = free_.back();
    free_.pop_back();
  }
  for (const auto& [word, weight] : bag->words) slots_of_word_[word].push_back(slot);
  bags_[slot] = std::move(bag);
  slots_.emplace(keyframe, slot);
}

void PlaceIndex::erase(KeyFrameId keyframe) {
  const auto found = slots_.find(keyframe);
  if (found == slots_.end()) return;
  for (const auto& [word, weight] : bags_[found->second]->words)
    std::erase(slots_of_word_[word], found->second);
  bags_[found->second].reset();
  free_.push_back(found->second);
  slots_.erase(found);
}

void PlaceIndex::follow(const Map& map) {
  std::vector<KeyFrameId> gone;
  std::vector<std::pair<KeyFrameId, std::shared_ptr<const FeatureSet>>> fresh;
  map.read([&](const MapView& view) {
    const std::vector<KeyFrameId> known = view.keyframe_ids();
    std::shared_lock lock(mutex_);
    for (const KeyFrameId id : known)
      if (!slots_.contains(id)) fresh.emplace_back(id, view.keyframe(id)->features);
    for (const auto& [id, slot] : slots_)
      if (!std::binary_search(known.begin(), known.end(), id)) gone.push_back(id);
    return 0;
  });
  for (const auto& [id, features] : fresh) add(id, vocabulary_->transform(features->descriptors()));
  for (const KeyFrameId id : gone) remove(id);
}

void PlaceIndex::add(KeyFrameId keyframe, BagOfWords bag) {
  auto shared = std::make_shared<const BagOfWords>(std::move(bag));
  std::unique_lock lock(mutex_);
  insert(keyframe, std::move(shared));
}

void PlaceIndex::remove(KeyFrameId keyframe) {
  std::unique_lock lock(mutex_);
  erase(keyframe);
}

void PlaceIndex::clear() {
  std::unique_lock lock(mutex_);
  slots_.clear();
  bags_.clear();
  free_.clear();
  for (auto& list : slots_of_word_) list.clear();
}

std::size_t PlaceIndex::size() const {
  std::shared_lock lock(mutex_);
  return slots_.size();
}

PlaceIndex::Bag PlaceIndex::bag(KeyFrameId keyframe) const {
  std::shared_lock lock(mutex_);
  const auto found = slots_.find(keyframe);
  return found == slots_.end() ? nullptr : bags_[found->second];
}

std::vector<KeyFrameId> PlaceIndex::candidates(const BagOfWords& bag, const MapView& map) const {
  return candidates(bag, map, {}, 0);
}

/// Keyframes that share many words with the bag and are similar enough, ascending, with their
/// similarity.
std::vector<std::pair<KeyFrameId, double>> PlaceIndex::similar(const BagOfWords& bag,
                                                               std::span<const KeyFrameId> exclude,
                                                               double min_score) const {
  std::shared_lock lock(mutex_);
  std::vector<int> common(bags_.size(), 0);
  for (const auto& [word, weight] : bag.words)
    for (const std::uint32_t slot : slots_of_word_[word]) ++common[slot];
  for (const KeyFrameId id : exclude)
    if (const auto found = slots_.find(id); found != slots_.end()) common[found->second] = 0;
  const int most = common.empty() ? 0 : *std::max_element(common.begin(), common.end());

  std::vector<std::pair<KeyFrameId, double>> scores;
  for (const auto& [id, slot] : slots_) {
    if (common[slot] == 0 || common[slot] <= kCommonWordShare * most) continue;
    const double score = similarity(bag, *bags_[slot]);
    if (score >= min_score) scores.emplace_back(id, score);
  }
  return scores;
}

std::vector<KeyFrameId> PlaceIndex::candidates(const BagOfWords& bag, const MapView& map,
                                               std::span<const KeyFrameId> exclude,
                                               double min_score) const {
  const auto scores = similar(bag, exclude, min_score);
  std::vector<Group> groups;
  double best_group = 0;
  for (const auto& [id, score] : scores) {
    const KeyFrame* keyframe = map.keyframe(id);
    if (!keyframe) continue;
    Group group{id, score};
    double best_score = score;
    const auto& covisibles = keyframe->covisibles;
    for (std::size_t i = 0; i < std::min(kGroupNeighbours, covisibles.size()); ++i) {
      const auto neighbour = std::lower_bound(
          scores.begin(), scores.end(), covisibles[i].id,
          [](const auto& entry, KeyFrameId wanted) { return entry.first < wanted; });
      if (neighbour == scores.end() || neighbour->first != covisibles[i].id) continue;
      group.score += neighbour->second;
      if (neighbour->second > best_score) {
        best_score = neighbour->second;
        group.best = neighbour->first;
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
