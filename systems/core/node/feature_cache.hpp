// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "node/feature_source.hpp"

namespace slambed {

/// The features of every frame of a sequence, extracted once and mapped by all later runs. They are
/// the same bytes that extraction gives, so a run with the cache equals a run without it.
///
/// Little-endian file: magic u32, version u32, frames u64, key length u32, key, padding to 8 bytes,
/// frames + 1 offsets u64; per frame: number n u32, crc32 u32 of what follows, n key points of 24
/// bytes, n descriptors of 32 bytes.
class FeatureCache final : public FeatureSource {
 public:
  /// Opens the cache, or makes it first (by rename: a process that makes it at the same time does
  /// no harm). key: everything the features depend on; a file with another key is made anew. Throws
  /// Error for a folder that cannot be written.
  FeatureCache(const std::filesystem::path& path, const std::string& key,
               const PreparedSequence& sequence, std::shared_ptr<const Sensor> sensor,
               const OrbOptions& options);
  ~FeatureCache() override;
  FeatureCache(const FeatureCache&) = delete;
  FeatureCache& operator=(const FeatureCache&) = delete;

  /// Throws Error(kBadInput) when the frame's bytes are damaged.
  std::shared_ptr<const FeatureSet> features(std::uint64_t frame) override;
  std::shared_ptr<const Sensor> sensor() const override { return sensor_; }

 private:
  bool open(const std::string& key);
  void close();
  std::uint64_t offset(std::uint64_t frame) const;

  std::filesystem::path path_;
  std::shared_ptr<const Sensor> sensor_;
  std::uint64_t frames_ = 0;
  std::span<const std::uint8_t> file_;
  std::size_t offsets_at_ = 0;
};

}  // namespace slambed
