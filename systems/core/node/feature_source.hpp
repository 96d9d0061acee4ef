// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>

#include "features/feature_set.hpp"
#include "features/orb_extractor.hpp"
#include "node/prepared_sequence.hpp"

namespace slambed {

/// Where the features of a frame come from: extraction when live, a cache when virtual.
class FeatureSource {
 public:
  virtual ~FeatureSource() = default;
  virtual std::shared_ptr<const FeatureSet> features(std::uint64_t frame) = 0;
  virtual std::shared_ptr<const Sensor> sensor() const = 0;
};

/// Extracts from a prepared sequence. Owns scratch memory: one per worker.
class ExtractingSource final : public FeatureSource {
 public:
  ExtractingSource(const PreparedSequence& sequence, std::shared_ptr<const Sensor> sensor,
                   const OrbOptions& options)
      : sequence_(sequence), sensor_(std::move(sensor)), extractor_(options) {}

  std::shared_ptr<const FeatureSet> features(std::uint64_t frame) override {
    const auto image = sequence_.frame(frame);
    return make_rgbd_features(extractor_, sensor_, image.grey, image.depth,
                              sequence_.depth_unit_m());
  }
  std::shared_ptr<const Sensor> sensor() const override { return sensor_; }

 private:
  const PreparedSequence& sequence_;
  std::shared_ptr<const Sensor> sensor_;
  OrbExtractor extractor_;
};

}  // namespace slambed
