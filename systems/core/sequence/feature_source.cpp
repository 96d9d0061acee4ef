// SPDX-License-Identifier: Apache-2.0
#include "sequence/feature_source.hpp"

#include <utility>

namespace slambed {

ExtractingSource::ExtractingSource(const PreparedSequence& sequence,
                                   std::shared_ptr<const Sensor> sensor, const OrbOptions& options)
    : sequence_(sequence),
      sensor_(std::move(sensor)),
      extractor_(std::make_unique<OrbExtractor>(options)) {
  if (sequence_.sensor() == SensorKind::kStereo)
    right_.emplace(Right{OrbExtractor(options), StereoMatcher(sensor_)});
}

void ExtractingSource::use_levels(int levels) {
  OrbOptions options = extractor_->options();
  if (options.levels == levels) return;
  options.levels = levels;
  extractor_ = std::make_unique<OrbExtractor>(options);
}

std::shared_ptr<const FeatureSet> ExtractingSource::features(std::uint64_t frame) {
  const auto image = sequence_.frame(frame);
  switch (sequence_.sensor()) {
    case SensorKind::kStereo:
      return make_stereo_features(*extractor_, right_->extractor, right_->matcher, sensor_,
                                  image.gray, image.right);
    case SensorKind::kMono:
      return make_mono_features(*extractor_, sensor_, image.gray);
    case SensorKind::kRgbd:
      break;
  }
  return make_rgbd_features(*extractor_, sensor_, image.gray, image.depth,
                            sequence_.depth_unit_m());
}

}  // namespace slambed
