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

/// An image as visual words, in ascending order, with weights that sum to one (L1). nodes is the
/// direct index: the features below each tree node of the matching level, all in ascending order.
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

/// A vocabulary tree of binary words (Galvez-Lopez and Tardos 2012). Each node's descriptor is the
/// median of its cluster. Leaves are words, weighted by inverse document frequency.
class Vocabulary {
 public:
  /// Trains on the descriptors of many images. Throws Error(kBadInput) without any descriptors or
  /// for options out of range.
  static Vocabulary train(std::span<const std::vector<Descriptor>> images,
                          const VocabularyOptions& options = {});
  /// Reads slambed's binary format. Throws Error(kBadInput) for a damaged or foreign file.
  static Vocabulary load(const std::filesystem::path& path);
  /// Reads the binary format from memory; errors name `source`.
  static Vocabulary parse(std::span<const std::uint8_t> bytes, const std::string& source);
  /// Reads DBoW2's text format (ORBvoc.txt).
  static Vocabulary load_dbow2_text(const std::filesystem::path& path);
  void save(const std::filesystem::path& path) const;

  BagOfWords transform(std::span<const Descriptor> descriptors) const;

  std::size_t words() const { return words_; }
  int branching() const { return branching_; }
  int depth() const { return depth_; }

 private:
  /// Children of a node are contiguous. A leaf has none and holds a word.
  struct Node {
    Descriptor descriptor{};
    std::uint32_t first_child = 0;
    std::uint32_t word = 0;
    float weight = 0;
    std::uint16_t children = 0;
    std::uint16_t level = 0;
  };

  friend class VocabularyTrainer;
  /// Throws Error(kBadInput) unless the links form a breadth-first tree and weights are valid.
  void check(const std::string& source) const;
  /// Returns the leaf of a descriptor and its ancestor on the matching level.
  std::pair<const Node*, std::uint32_t> find(const Descriptor& descriptor) const;
  int matching_level() const;

  std::vector<Node> nodes_;  ///< root first, breadth first
  std::size_t words_ = 0;
  int branching_ = 0;
  int depth_ = 0;
};

}  // namespace slambed
