// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "sequence/frame_file.hpp"
#include "sequence/prepared_sequence.hpp"
#include "wire/byte_io.hpp"

namespace slambed {

/// The pictures of a sequence as JPEG: coded when live, from a cache when virtual.
class ImageSource {
 public:
  virtual ~ImageSource() = default;
  virtual wire::Bytes jpeg(std::uint64_t frame) = 0;
};

/// Codes each picture when it is asked for.
class EncodingSource final : public ImageSource {
 public:
  EncodingSource(const PreparedSequence& sequence, int quality)
      : sequence_(sequence), quality_(quality) {}
  wire::Bytes jpeg(std::uint64_t frame) override;

 private:
  const PreparedSequence& sequence_;
  int quality_;
};

/// The JPEG of every frame, coded once and mapped by all later runs: the bytes that coding gives,
/// so that sizes in virtual time are true. A FrameFile; a block is one JPEG, its count the JPEG's
/// size.
class ImageCache final : public ImageSource {
 public:
  /// As FeatureCache: opens it, or makes it first.
  ImageCache(const std::filesystem::path& path, const std::string& key,
             const PreparedSequence& sequence, int quality);
  wire::Bytes jpeg(std::uint64_t frame) override;

 private:
  FrameFile file_;
};

}  // namespace slambed
