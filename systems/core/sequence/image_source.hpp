// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "sequence/frame_file.hpp"
#include "sequence/prepared_sequence.hpp"
#include "wire/byte_io.hpp"

namespace slambed {

/// Source of a sequence's images as JPEG: encoded in live runs, from a cache in virtual ones.
class ImageSource {
 public:
  virtual ~ImageSource() = default;
  virtual wire::Bytes jpeg(std::uint64_t frame) = 0;
};

class EncodingSource final : public ImageSource {
 public:
  EncodingSource(const PreparedSequence& sequence, int quality)
      : sequence_(sequence), quality_(quality) {}
  wire::Bytes jpeg(std::uint64_t frame) override;

 private:
  const PreparedSequence& sequence_;
  int quality_;
};

/// The JPEG of every frame, encoded once and mapped by all later runs. The bytes are those of
/// EncodingSource, so message sizes in virtual time are real. The file is a FrameFile: a block is
/// one JPEG, and its count is the JPEG's size.
class ImageCache final : public ImageSource {
 public:
  /// Opens the cache, or makes it first, as FeatureCache does.
  ImageCache(const std::filesystem::path& path, const std::string& key,
             const PreparedSequence& sequence, int quality);
  wire::Bytes jpeg(std::uint64_t frame) override;

 private:
  FrameFile file_;
};

}  // namespace slambed
