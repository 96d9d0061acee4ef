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
/// The user of the class defines what a block contains.
///
/// Little-endian: magic u32, version u32, frames u64, key length u32, key, padding to 8 bytes,
/// frames + 1 offsets u64; per frame: count u32, crc32 u32 of what follows, the bytes.
class FrameFile {
 public:
  struct Kind {
    std::string name;  ///< for messages: "feature cache"
    std::uint32_t magic = 0, version = 1;
  };
  /// A frame's bytes, and a number that the user of the class defines.
  struct Block {
    std::uint32_t count = 0;
    std::span<const std::uint8_t> bytes;
  };
  struct OwnedBlock {
    std::uint32_t count = 0;
    std::vector<std::uint8_t> bytes;
  };
  using Make = std::function<OwnedBlock(std::uint64_t frame)>;

  /// Parses one frame's count, CRC-32 and bytes from any source. Returns nothing if damaged.
  static std::optional<Block> parse(std::span<const std::uint8_t> bytes);

  FrameFile(Kind kind, std::filesystem::path path, std::uint64_t frames);

  /// Maps the file. Returns false if there is none with this number of frames and this key
  /// (everything that the blocks depend on).
  bool open(const std::string& key);
  /// Opens the file, or makes it first. It is written by rename, so another process may make it at
  /// the same time. Throws Error if the folder is not writable.
  void open_or_make(const std::string& key, const Make& make);
  /// Throws Error(kBadInput) if the frame's bytes are damaged.
  Block block(std::uint64_t frame) const;
  /// Throws Error(kBadInput). For users that find a frame's content invalid.
  [[noreturn]] void refuse(std::uint64_t frame, const std::string& what) const;

 private:
  void make_all(const std::string& key, const Make& make) const;
  std::uint64_t offset(std::uint64_t frame) const;

  Kind kind_;
  std::filesystem::path path_;
  std::uint64_t frames_ = 0;
  MappedFile mapped_;
  std::span<const std::uint8_t> file_;  ///< bytes of mapped_
  std::size_t offsets_at_ = 0;
};

}  // namespace slambed
