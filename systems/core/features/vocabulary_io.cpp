// SPDX-License-Identifier: Apache-2.0
// Binary format, little-endian: magic u32, version u16, branching u16, depth u16, reserved u16,
// nodes u32, words u32, crc32 u32 of the rest. Then per node: descriptor 32 bytes, first child u32,
// weight f32, children u16, level u16, padding u32. Words are numbered in the order of the leaves.
#include <zlib.h>

#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <sstream>
#include <string>

#include "base/error.hpp"
#include "base/files.hpp"
#include "features/vocabulary.hpp"

namespace slambed {
namespace {

static_assert(std::endian::native == std::endian::little, "the formats are read as they lie");

constexpr std::uint32_t kMagic = 0x43564C53;  // "SLVC"
constexpr std::uint16_t kVersion = 1;
constexpr std::uint32_t kMaxNodes = 20'000'000;

struct Header {
  std::uint32_t magic = kMagic;
  std::uint16_t version = kVersion;
  std::uint16_t branching = 0, depth = 0, reserved = 0;
  std::uint32_t nodes = 0, words = 0, crc = 0;
};
static_assert(sizeof(Header) == 24);

struct Record {
  Descriptor descriptor{};
  std::uint32_t first_child = 0;
  float weight = 0;
  std::uint16_t children = 0, level = 0;
  std::uint32_t padding = 0;
};
static_assert(sizeof(Record) == 48);

std::uint32_t crc_of(const std::vector<Record>& records) {
  return static_cast<std::uint32_t>(::crc32_z(0, reinterpret_cast<const Bytef*>(records.data()),
                                              records.size() * sizeof(Record)));
}

Error damaged(const std::string& source, const std::string& what) {
  return bad_input("vocabulary " + source + ": " + what + "; train or fetch it again");
}

}  // namespace

void Vocabulary::check(const std::string& source) const {
  if (nodes_.empty() || branching_ < 2 || depth_ < 1) throw damaged(source, "empty tree");
  std::uint32_t next = 1;
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const Node& node = nodes_[i];
    if (!std::isfinite(node.weight) || node.weight < 0)
      throw damaged(source, "weight out of range");
    if (node.children == 0) continue;
    // Breadth first: every node but the root is the child of exactly one earlier node.
    if (node.first_child != next || node.first_child + node.children > nodes_.size()) {
      throw damaged(source, "broken links");
    }
    for (std::uint32_t c = next; c < next + node.children; ++c) {
      if (nodes_[c].level != node.level + 1) throw damaged(source, "broken levels");
    }
    next += node.children;
  }
  if (next != nodes_.size()) throw damaged(source, "loose nodes");
}

void Vocabulary::save(const std::filesystem::path& path) const {
  std::vector<Record> records;
  records.reserve(nodes_.size());
  for (const Node& n : nodes_) {
    records.push_back({n.descriptor, n.first_child, n.weight, n.children, n.level, 0});
  }
  Header header;
  header.branching = static_cast<std::uint16_t>(branching_);
  header.depth = static_cast<std::uint16_t>(depth_);
  header.nodes = static_cast<std::uint32_t>(nodes_.size());
  header.words = static_cast<std::uint32_t>(words_);
  header.crc = crc_of(records);
  write_whole(path, {{reinterpret_cast<const std::uint8_t*>(&header), sizeof header},
                     {reinterpret_cast<const std::uint8_t*>(records.data()),
                      records.size() * sizeof(Record)}});
}

Vocabulary Vocabulary::load(const std::filesystem::path& path) {
  const auto most = sizeof(Header) + std::uintmax_t{kMaxNodes} * sizeof(Record);
  return parse(read_whole(path, "vocabulary", most), path.string());
}

Vocabulary Vocabulary::parse(std::span<const std::uint8_t> bytes, const std::string& source) {
  Header header;
  if (bytes.size() < sizeof header) throw damaged(source, "not a slambed vocabulary");
  std::memcpy(&header, bytes.data(), sizeof header);
  if (header.magic != kMagic) throw damaged(source, "not a slambed vocabulary");
  if (header.version != kVersion) throw damaged(source, "unknown version");
  if (header.nodes == 0 || header.nodes > kMaxNodes || header.words > header.nodes)
    throw damaged(source, "impossible size");
  if (bytes.size() != sizeof(Header) + header.nodes * sizeof(Record))
    throw damaged(source, "file is cut or too long");
  std::vector<Record> records(header.nodes);
  std::memcpy(records.data(), bytes.data() + sizeof header, records.size() * sizeof(Record));
  if (crc_of(records) != header.crc) throw damaged(source, "checksum does not match");

  Vocabulary vocabulary;
  vocabulary.branching_ = header.branching;
  vocabulary.depth_ = header.depth;
  vocabulary.nodes_.reserve(records.size());
  for (const Record& r : records) {
    Node node;
    node.descriptor = r.descriptor;
    node.first_child = r.first_child;
    node.weight = r.weight;
    node.children = r.children;
    node.level = r.level;
    if (r.children == 0) node.word = static_cast<std::uint32_t>(vocabulary.words_++);
    vocabulary.nodes_.push_back(node);
  }
  if (vocabulary.words_ != header.words) throw damaged(source, "number of words does not match");
  vocabulary.check(source);
  return vocabulary;
}

Vocabulary Vocabulary::load_dbow2_text(const std::filesystem::path& path) {
  const std::string source = path.string();
  std::ifstream in(path);
  int k = 0, depth = 0, scoring = 0, weighting = 0;
  std::string line;
  if (!in || !std::getline(in, line) ||
      !(std::istringstream(line) >> k >> depth >> scoring >> weighting) || k < 2 || k > 256 ||
      depth < 1 || depth > 10) {
    throw bad_input("vocabulary " + source + ": not DBoW2's text format; check the path");
  }
  struct Line {
    Descriptor descriptor{};
    std::vector<std::uint32_t> children;
    float weight = 0;
  };
  std::vector<Line> lines(1);
  while (std::getline(in, line)) {
    if (line.find_first_not_of(" \r\t") == std::string::npos) continue;
    std::istringstream fields(line);
    std::uint32_t parent = 0;
    int leaf = 0;
    Line entry;
    fields >> parent >> leaf;
    for (int byte = 0; byte < 32; ++byte) {
      int value = -1;
      fields >> value;
      if (!fields || value < 0 || value > 255) {
        throw damaged(source, "line " + std::to_string(lines.size() + 1) + " is malformed");
      }
      entry.descriptor[byte / 8] |= static_cast<std::uint64_t>(value) << (8 * (byte % 8));
    }
    fields >> entry.weight;
    if (!fields || parent >= lines.size()) {
      throw damaged(source, "line " + std::to_string(lines.size() + 1) + " is malformed");
    }
    lines[parent].children.push_back(static_cast<std::uint32_t>(lines.size()));
    lines.push_back(std::move(entry));
  }
  // Renumber breadth first, so that siblings are contiguous.
  Vocabulary vocabulary;
  vocabulary.branching_ = k;
  vocabulary.depth_ = depth;
  std::vector<std::uint32_t> order{0};
  vocabulary.nodes_.emplace_back();
  for (std::size_t i = 0; i < order.size(); ++i) {
    const Line& entry = lines[order[i]];
    vocabulary.nodes_[i].children = static_cast<std::uint16_t>(entry.children.size());
    if (entry.children.empty()) {
      vocabulary.nodes_[i].word = static_cast<std::uint32_t>(vocabulary.words_++);
      vocabulary.nodes_[i].weight = entry.weight;
      continue;
    }
    vocabulary.nodes_[i].first_child = static_cast<std::uint32_t>(order.size());
    for (const std::uint32_t child : entry.children) {
      Node node;
      node.descriptor = lines[child].descriptor;
      node.level = static_cast<std::uint16_t>(vocabulary.nodes_[i].level + 1);
      vocabulary.nodes_.push_back(node);
      order.push_back(child);
    }
  }
  vocabulary.check(source);
  return vocabulary;
}

}  // namespace slambed
