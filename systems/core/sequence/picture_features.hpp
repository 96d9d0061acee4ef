// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>

#include "sequence/feature_source.hpp"
#include "sequence/image_source.hpp"
#include "wire/image_codec.hpp"

namespace slambed {

/// Features of images that arrive over the network as JPEG. Decoding and extraction are separate
/// stages. Use one object per worker.
class PictureFeatures {
 public:
  virtual ~PictureFeatures() = default;
  /// Throws wire::DecodeError unless the data are a gray image of the camera's size.
  virtual void decode(std::span<const std::uint8_t> jpeg) = 0;
  /// Returns the features of the image decoded last, which must be this frame of the sequence.
  virtual std::shared_ptr<const FeatureSet> extract(std::uint64_t frame) = 0;
};

class DecodedPictures final : public PictureFeatures {
 public:
  using SensorOf = std::function<std::shared_ptr<const Sensor>()>;
  /// sensor: called for each image, because the peer's camera is unknown at first. While it returns
  /// null, images are refused.
  DecodedPictures(SensorOf sensor, const OrbOptions& options)
      : sensor_(std::move(sensor)), extractor_(options) {}

  void decode(std::span<const std::uint8_t> jpeg) override;
  std::shared_ptr<const FeatureSet> extract(std::uint64_t frame) override;

 private:
  SensorOf sensor_;
  OrbExtractor extractor_;
  wire::GrayImage image_;
};

/// For virtual runs: only checks the JPEG's header and end, and takes the features from a source
/// that was filled earlier.
class KnownPictures final : public PictureFeatures {
 public:
  explicit KnownPictures(FeatureSource& features) : features_(features) {}

  void decode(std::span<const std::uint8_t> jpeg) override;
  std::shared_ptr<const FeatureSet> extract(std::uint64_t frame) override {
    return features_.features(frame);
  }

 private:
  FeatureSource& features_;
};

/// The features that the edge extracts from a sequence's images after JPEG compression.
class JpegFeatureSource final : public FeatureSource {
 public:
  JpegFeatureSource(ImageSource& images, std::shared_ptr<const Sensor> sensor,
                    const OrbOptions& options)
      : images_(images),
        sensor_(std::move(sensor)),
        pictures_([this] { return sensor_; }, options) {}

  std::shared_ptr<const FeatureSet> features(std::uint64_t frame) override;
  std::shared_ptr<const Sensor> sensor() const override { return sensor_; }

 private:
  ImageSource& images_;
  std::shared_ptr<const Sensor> sensor_;
  DecodedPictures pictures_;
};

}  // namespace slambed
