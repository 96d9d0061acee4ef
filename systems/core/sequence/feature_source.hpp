// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "features/feature_set.hpp"
#include "features/orb_extractor.hpp"
#include "features/stereo_matcher.hpp"
#include "sequence/prepared_sequence.hpp"

namespace slambed {

/// Source of a frame's features: extraction in live runs, a cache in virtual ones.
class FeatureSource {
 public:
  virtual ~FeatureSource() = default;
  virtual std::shared_ptr<const FeatureSet> features(std::uint64_t frame) = 0;
  virtual std::shared_ptr<const Sensor> sensor() const = 0;
  /// Sets the number of octaves from the next frame on; the number of features does not change.
  /// Sources without octaves ignore it.
  virtual void use_levels(int) {}
};

/// Extracts from a prepared sequence of any sensor. Owns scratch memory, so use one per worker.
class ExtractingSource final : public FeatureSource {
 public:
  ExtractingSource(const PreparedSequence& sequence, std::shared_ptr<const Sensor> sensor,
                   const OrbOptions& options);

  std::shared_ptr<const FeatureSet> features(std::uint64_t frame) override;
  std::shared_ptr<const Sensor> sensor() const override { return sensor_; }
  void use_levels(int levels) override;

 private:
  /// Used for stereo sequences only.
  struct Right {
    OrbExtractor extractor;
    StereoMatcher matcher;
  };

  const PreparedSequence& sequence_;
  std::shared_ptr<const Sensor> sensor_;
  std::unique_ptr<OrbExtractor> extractor_;
  std::optional<Right> right_;
};

}  // namespace slambed
