// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <vector>

#include "base/fd.hpp"
#include "base/time.hpp"
#include "features/feature_set.hpp"
#include "sequence/mask_source.hpp"

namespace slambed {

struct SegmenterOptions {
  std::filesystem::path socket;                   ///< Unix socket of slambed.segment.server
  Duration time_limit = std::chrono::seconds(2);  ///< per image, from request to answer
};

/// Gets masks from a segmenter process on the edge host (docs/explanation/masks.md, "The segmenter
/// of live runs"). If it fails, the image has no masks but a failure text, and the next image uses
/// a new connection. Use one object per worker.
class SegmenterClient final : public MaskSource {
 public:
  using SensorOf = std::function<std::shared_ptr<const Sensor>()>;
  /// sensor: called for each image, because the peer's camera is unknown at first.
  SegmenterClient(SegmenterOptions options, SensorOf sensor)
      : options_(std::move(options)), sensor_(std::move(sensor)) {}

  Segmentation masks(std::uint64_t frame, std::span<const std::uint8_t> jpeg,
                     double threshold) override;
  bool live() const override { return true; }

 private:
  using Clock = std::chrono::steady_clock;

  FrameMasks answered(std::span<const std::uint8_t> jpeg, double threshold);
  void call();
  void send(std::span<const std::uint8_t> bytes);
  std::vector<std::uint8_t> receive(std::size_t size);
  void wait_for(short what) const;

  SegmenterOptions options_;
  SensorOf sensor_;
  FileDescriptor fd_;
  Clock::time_point deadline_{};
};

}  // namespace slambed
