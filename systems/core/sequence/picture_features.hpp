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

/// Features of pictures that come over the network as JPEG, in two steps that are two stages. For
/// one worker.
class PictureFeatures {
 public:
  virtual ~PictureFeatures() = default;
  /// Throws wire::DecodeError for what is no gray picture of the camera's size.
  virtual void decode(std::span<const std::uint8_t> jpeg) = 0;
  /// Of the picture that was decoded last, which is this frame of the sequence.
  virtual std::shared_ptr<const FeatureSet> extract(std::uint64_t frame) = 0;
};

/// Decodes and extracts.
class DecodedPictures final : public PictureFeatures {
 public:
  using SensorOf = std::function<std::shared_ptr<const Sensor>()>;
  /// sensor: asked for each picture, as the peer's camera is not known at first; null then refuses
  /// it.
  DecodedPictures(SensorOf sensor, const OrbOptions& options)
      : sensor_(std::move(sensor)), extractor_(options) {}

  void decode(std::span<const std::uint8_t> jpeg) override;
  std::shared_ptr<const FeatureSet> extract(std::uint64_t frame) override;

 private:
  SensorOf sensor_;
  OrbExtractor extractor_;
  wire::GrayImage image_;
};

/// Virtual runs: looks whether a picture could be decoded, and takes its features from where they
/// were extracted once.
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

/// What the edge extracts from a sequence's pictures: of each as JPEG decodes it.
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
