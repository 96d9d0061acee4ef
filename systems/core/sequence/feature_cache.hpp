// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "sequence/feature_source.hpp"
#include "sequence/frame_file.hpp"

namespace slambed {

/// The features of every frame of a sequence, extracted once and mapped by all later runs. They are
/// bit-identical to extracted ones, so a run with the cache equals a run without it.
///
/// The file is a FrameFile. A block's count is the number of features n; its bytes are n key points
/// of 24 bytes and n descriptors of 32 bytes.
class FeatureCache final : public FeatureSource {
 public:
  /// Opens the cache. If it does not exist or has another key, first makes it from `source`, which
  /// is not used after the constructor. key: everything that the features depend on. Throws Error
  /// if the folder is not writable.
  FeatureCache(const std::filesystem::path& path, const std::string& key, std::uint64_t frames,
               FeatureSource& source);

  /// Throws Error(kBadInput) if the frame's bytes are damaged.
  std::shared_ptr<const FeatureSet> features(std::uint64_t frame) override;
  std::shared_ptr<const Sensor> sensor() const override { return sensor_; }

 private:
  std::shared_ptr<const Sensor> sensor_;
  FrameFile file_;
};

/// One feature source per number of octaves; one of them is in use.
class LeveledFeatures final : public FeatureSource {
 public:
  LeveledFeatures(std::map<int, std::unique_ptr<FeatureSource>> by_levels, int levels)
      : by_levels_(std::move(by_levels)), used_(by_levels_.at(levels).get()) {}

  std::shared_ptr<const FeatureSet> features(std::uint64_t frame) override {
    return used_->features(frame);
  }
  std::shared_ptr<const Sensor> sensor() const override { return used_->sensor(); }
  /// Throws if there is no source for this number.
  void use_levels(int levels) override { used_ = by_levels_.at(levels).get(); }

 private:
  std::map<int, std::unique_ptr<FeatureSource>> by_levels_;
  FeatureSource* used_;
};

}  // namespace slambed
