// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/files.hpp"
#include "features/feature_set.hpp"
#include "features/image.hpp"
#include "geometry/camera.hpp"

namespace slambed {

/// "rgbd", "stereo" or "mono".
const char* sensor_name(SensorKind kind);

/// A prepared sequence (docs/reference/sequence.md), mapped read-only: frames are loaded on first
/// access.
class PreparedSequence {
 public:
  struct Frame {
    std::uint64_t index = 0;
    std::int64_t timestamp_ns = 0;  ///< since time_origin
    GrayView gray;
    DepthView depth;  ///< in RGB-D sequences
    GrayView right;   ///< in stereo sequences
  };

  /// Checks header, sizes, timestamps and the first frame's checksum. Throws bad_input if the
  /// folder is not a prepared sequence or is damaged.
  explicit PreparedSequence(std::filesystem::path folder);
  PreparedSequence(const PreparedSequence&) = delete;
  PreparedSequence& operator=(const PreparedSequence&) = delete;

  const std::string& id() const { return id_; }
  SensorKind sensor() const { return sensor_; }
  /// In a monocular sequence the baseline is 0, whatever the file contains.
  const Camera& camera() const { return camera_; }
  double depth_unit_m() const { return depth_unit_m_; }
  double close_depth_m() const { return close_depth_baselines_ * camera_.baseline_m(); }
  double fps() const { return fps_; }
  std::int64_t time_origin_ns() const { return time_origin_ns_; }
  std::uint64_t frames() const { return timestamps_ns_.size(); }
  std::span<const std::int64_t> timestamps_ns() const { return timestamps_ns_; }
  Frame frame(std::uint64_t index) const;

  /// Compares one frame with its checksum. Throws bad_input if it differs.
  void verify(std::uint64_t index) const;
  void verify_all() const;

 private:
  void read_header();
  void read_index();
  void map_frames();
  std::size_t block_bytes() const;

  std::filesystem::path folder_;
  std::string id_;
  SensorKind sensor_ = SensorKind::kRgbd;
  Camera camera_;
  double depth_unit_m_ = 0, close_depth_baselines_ = 0, fps_ = 0;
  std::int64_t time_origin_ns_ = 0;
  std::uint64_t frame_count_ = 0;
  std::size_t stride_bytes_ = 0;
  std::vector<std::int64_t> timestamps_ns_;
  std::vector<std::uint32_t> checksums_;
  MappedFile file_;
  const std::uint8_t* data_ = nullptr;  ///< bytes of file_
};

}  // namespace slambed
