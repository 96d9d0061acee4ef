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
  std::filesystem::path socket;                   ///< where slambed.segment.server answers
  Duration time_limit = std::chrono::seconds(2);  ///< of a picture, from the question on
};

/// Masks of a process beside the edge node (docs/explanation/masks.md, "In live runs"). Whatever
/// it does wrong is told with the picture that has no masks then, and the next one finds a new
/// connection. For one worker.
class SegmenterClient final : public MaskSource {
 public:
  using SensorOf = std::function<std::shared_ptr<const Sensor>()>;
  /// sensor: asked for each picture, as the peer's camera is not known at first.
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
