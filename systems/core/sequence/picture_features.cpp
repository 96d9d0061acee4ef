// SPDX-License-Identifier: Apache-2.0
#include "sequence/picture_features.hpp"

namespace slambed {

void DecodedPictures::decode(std::span<const std::uint8_t> jpeg) {
  const auto sensor = sensor_();
  if (!sensor) throw wire::DecodeError("picture of an unknown camera");
  image_ = wire::decode_jpeg(jpeg, sensor->camera.width, sensor->camera.height);
}

std::shared_ptr<const FeatureSet> DecodedPictures::extract(std::uint64_t) {
  return make_mono_features(extractor_, sensor_(), image_.view());
}

void KnownPictures::decode(std::span<const std::uint8_t> jpeg) {
  const Camera& camera = features_.sensor()->camera;
  wire::check_jpeg(jpeg, camera.width, camera.height);
}

std::shared_ptr<const FeatureSet> JpegFeatureSource::features(std::uint64_t frame) {
  pictures_.decode(images_.jpeg(frame));
  return pictures_.extract(frame);
}

}  // namespace slambed
