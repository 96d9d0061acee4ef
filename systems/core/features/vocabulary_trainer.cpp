// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstdint>
#include <numeric>

#include "base/error.hpp"
#include "base/portable_math.hpp"
#include "base/random.hpp"
#include "features/vocabulary.hpp"

namespace slambed {
namespace {

using Members = std::vector<std::uint32_t>;

/// Returns the bit-wise majority; ties become zero.
Descriptor median(std::span<const Descriptor> all, const Members& members) {
  std::array<std::uint32_t, 256> ones{};
  for (const std::uint32_t member : members) {
    for (int bit = 0; bit < 256; ++bit) ones[bit] += (all[member][bit / 64] >> (bit % 64)) & 1u;
  }
  Descriptor result{};
  for (int bit = 0; bit < 256; ++bit) {
    if (2 * ones[bit] > members.size()) result[bit / 64] |= std::uint64_t{1} << (bit % 64);
  }
  return result;
}

struct Clusters {
  std::vector<Descriptor> centers;
  std::vector<Members> members;
};

/// k-means++ seeding on Hamming distance squared; stops early when every member equals a center.
std::vector<Descriptor> seed_centers(std::span<const Descriptor> all, const Members& members, int k,
                                     SplitMix64& random) {
  std::vector<Descriptor> centers{all[members[random.below(members.size())]]};
  std::vector<std::uint64_t> nearest(members.size(), ~std::uint64_t{0});
  while (static_cast<int>(centers.size()) < k) {
    std::uint64_t total = 0;
    for (std::size_t i = 0; i < members.size(); ++i) {
      const std::uint64_t d = hamming(all[members[i]], centers.back());
      nearest[i] = std::min(nearest[i], d * d);
      total += nearest[i];
    }
    if (total == 0) break;
    std::uint64_t target = random.below(total);
    std::size_t chosen = 0;
    while (target >= nearest[chosen]) target -= nearest[chosen++];
    centers.push_back(all[members[chosen]]);
  }
  return centers;
}

Clusters k_medians(std::span<const Descriptor> all, const Members& members, int k, int rounds,
                   SplitMix64& random) {
  Clusters clusters;
  clusters.centers = seed_centers(all, members, k, random);
  for (int round = 0; round < rounds; ++round) {
    clusters.members.assign(clusters.centers.size(), {});
    for (const std::uint32_t member : members) {
      int best = 0, best_distance = 257;
      for (std::size_t c = 0; c < clusters.centers.size(); ++c) {
        const int distance = hamming(all[member], clusters.centers[c]);
        if (distance < best_distance) best_distance = distance, best = static_cast<int>(c);
      }
      clusters.members[best].push_back(member);
    }
    bool moved = false;
    for (std::size_t c = 0; c < clusters.centers.size(); ++c) {
      if (clusters.members[c].empty()) continue;
      const Descriptor center = median(all, clusters.members[c]);
      moved |= center != clusters.centers[c];
      clusters.centers[c] = center;
    }
    if (!moved) break;
  }
  return clusters;
}

}  // namespace

/// Grows the tree breadth first, so that siblings are contiguous.
class VocabularyTrainer {
 public:
  static Vocabulary train(std::span<const std::vector<Descriptor>> images,
                          const VocabularyOptions& options) {
    std::vector<Descriptor> all;
    for (const auto& image : images) all.insert(all.end(), image.begin(), image.end());
    if (all.empty()) throw bad_input("vocabulary: no descriptors to train on; give more images");
    if (options.branching < 2 || options.branching > 256 || options.depth < 1 ||
        options.depth > 8) {
      throw bad_input("vocabulary: branching must be 2..256 and depth 1..8");
    }
    Vocabulary vocabulary;
    vocabulary.branching_ = options.branching;
    vocabulary.depth_ = options.depth;
    grow(vocabulary, all, options);
    weigh(vocabulary, images);
    return vocabulary;
  }

 private:
  static void grow(Vocabulary& v, std::span<const Descriptor> all, const VocabularyOptions& o) {
    SplitMix64 random(o.seed);
    v.nodes_.emplace_back();
    std::vector<Members> members(1, Members(all.size()));
    std::iota(members[0].begin(), members[0].end(), 0u);
    for (std::size_t index = 0; index < v.nodes_.size(); ++index) {
      const int level = v.nodes_[index].level;
      const Members mine = std::move(members[index]);
      if (level == o.depth || mine.size() <= 1) {
        v.nodes_[index].word = static_cast<std::uint32_t>(v.words_++);
        continue;
      }
      Clusters clusters = k_medians(all, mine, o.branching, o.rounds, random);
      v.nodes_[index].first_child = static_cast<std::uint32_t>(v.nodes_.size());
      for (std::size_t c = 0; c < clusters.centers.size(); ++c) {
        if (clusters.members[c].empty()) continue;
        Vocabulary::Node child;
        child.descriptor = clusters.centers[c];
        child.level = static_cast<std::uint16_t>(level + 1);
        v.nodes_.push_back(child);
        members.push_back(std::move(clusters.members[c]));
        ++v.nodes_[index].children;
      }
    }
  }

  /// Inverse document frequency over the training images: ln(N / n).
  static void weigh(Vocabulary& v, std::span<const std::vector<Descriptor>> images) {
    std::vector<std::uint32_t> seen_in(v.words_, 0), last_image(v.words_, 0);
    for (std::size_t image = 0; image < images.size(); ++image) {
      for (const Descriptor& descriptor : images[image]) {
        const std::uint32_t word = v.find(descriptor).first->word;
        if (last_image[word] == image + 1) continue;
        last_image[word] = static_cast<std::uint32_t>(image + 1);
        ++seen_in[word];
      }
    }
    for (Vocabulary::Node& node : v.nodes_) {
      if (node.children > 0) continue;
      // A single training image has no document frequency, so all words weigh the same.
      node.weight = images.size() < 2
                        ? 1.0f
                        : static_cast<float>(portable::log(static_cast<double>(images.size()) /
                                                           std::max(1u, seen_in[node.word])));
    }
  }
};

Vocabulary Vocabulary::train(std::span<const std::vector<Descriptor>> images,
                             const VocabularyOptions& options) {
  return VocabularyTrainer::train(images, options);
}

}  // namespace slambed
