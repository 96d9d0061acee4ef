// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/files.hpp"

namespace slambed {

/// A file with one block of bytes per frame of a sequence, made once and mapped by all later runs.
/// What a block says is its owner's.
///
/// Little-endian: magic u32, version u32, frames u64, key length u32, key, padding to 8 bytes,
/// frames + 1 offsets u64; per frame: count u32, crc32 u32 of what follows, the bytes.
class FrameFile {
 public:
  struct Kind {
    std::string name;  ///< for messages: "feature cache"
    std::uint32_t magic = 0, version = 1;
  };
  /// A frame's bytes and a number of its owner's.
  struct Block {
    std::uint32_t count = 0;
    std::span<const std::uint8_t> bytes;
  };
  struct OwnedBlock {
    std::uint32_t count = 0;
    std::vector<std::uint8_t> bytes;
  };
  using Make = std::function<OwnedBlock(std::uint64_t frame)>;

  /// One frame's count, CRC-32 and bytes, wherever they come from; nothing for what is damaged.
  static std::optional<Block> parse(std::span<const std::uint8_t> bytes);

  FrameFile(Kind kind, std::filesystem::path path, std::uint64_t frames);

  /// Maps the file; false when there is none for these frames and this key (everything that the
  /// blocks depend on).
  bool open(const std::string& key);
  /// Opens it, or makes it first (by rename: a process that makes it at the same time does no
  /// harm). Throws Error for a folder that cannot be written.
  void open_or_make(const std::string& key, const Make& make);
  /// Throws Error(kBadInput) when the frame's bytes are damaged.
  Block block(std::uint64_t frame) const;
  /// To throw when a frame's bytes are whole and yet make no sense.
  [[noreturn]] void refuse(std::uint64_t frame, const std::string& what) const;

 private:
  void make_all(const std::string& key, const Make& make) const;
  std::uint64_t offset(std::uint64_t frame) const;

  Kind kind_;
  std::filesystem::path path_;
  std::uint64_t frames_ = 0;
  MappedFile mapped_;
  std::span<const std::uint8_t> file_;  ///< its bytes
  std::size_t offsets_at_ = 0;
};

}  // namespace slambed
