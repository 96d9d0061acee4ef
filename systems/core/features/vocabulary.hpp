// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "features/keypoint.hpp"

namespace slambed {

/// An image as visual words: weights sum to one (L1), words ascending. The direct index lists, per
/// tree node of the matching level, the features that fell into it, nodes and features ascending.
struct BagOfWords {
  std::vector<std::pair<std::uint32_t, float>> words;
  std::vector<std::pair<std::uint32_t, std::vector<std::uint16_t>>> nodes;
};

/// L1 similarity of Nister and Stewenius (2006), in [0, 1].
double similarity(const BagOfWords& a, const BagOfWords& b);

struct VocabularyOptions {
  int branching = 10;
  int depth = 4;    ///< levels below the root: at most branching^depth words
  int rounds = 12;  ///< k-medians iterations per node
  std::uint64_t seed = 1;
};

/// A tree of binary words (Galvez-Lopez and Tardos 2012): each node's children are the medians of
/// the descriptors below it; leaves are words, weighted by inverse document frequency.
class Vocabulary {
 public:
  /// Trains on the descriptors of many images. Throws Error(kBadInput) without any descriptor.
  static Vocabulary train(std::span<const std::vector<Descriptor>> images,
                          const VocabularyOptions& options = {});
  /// Reads our binary format; throws Error(kBadInput) for a file that is damaged or something else.
  static Vocabulary load(const std::filesystem::path& path);
  /// The same from memory; source is named in errors.
  static Vocabulary parse(std::span<const std::uint8_t> bytes, const std::string& source);
  /// Reads DBoW2's text format (ORBvoc.txt).
  static Vocabulary load_dbow2_text(const std::filesystem::path& path);
  void save(const std::filesystem::path& path) const;

  BagOfWords transform(std::span<const Descriptor> descriptors) const;

  std::size_t words() const { return words_; }
  int branching() const { return branching_; }
  int depth() const { return depth_; }

 private:
  /// Children of a node are contiguous; a leaf has none and carries a word.
  struct Node {
    Descriptor descriptor{};
    std::uint32_t first_child = 0;
    std::uint32_t word = 0;
    float weight = 0;
    std::uint16_t children = 0;
    std::uint16_t level = 0;
  };

  friend class VocabularyTrainer;
  /// Throws Error(kBadInput) unless every link points forward and inside and weights are finite.
  void check(const std::string& source) const;
  /// Leaf of a descriptor, and the node passed at the matching level.
  std::pair<const Node*, std::uint32_t> find(const Descriptor& descriptor) const;
  int matching_level() const;

  std::vector<Node> nodes_;  ///< root first, breadth first
  std::size_t words_ = 0;
  int branching_ = 0;
  int depth_ = 0;
};

}  // namespace slambed
