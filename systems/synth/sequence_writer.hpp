// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "geometry/camera.hpp"
#include "geometry/se3.hpp"

namespace slambed::synth {

/// Header of a prepared sequence (docs/reference/sequence.md).
struct SequenceHeader {
  std::string id, title;
  std::string sensor;  ///< "rgbd", "stereo" or "mono"
  Camera camera;
  double fps = 30;
  double depth_unit_m = 0;
  double close_depth_baselines = 40;
  double time_origin_s = 0;
};

/// The planes of one frame in file order and their CRC; rendering threads fill it.
struct FrameBlock {
  std::vector<std::uint8_t> bytes;
  std::uint32_t crc32 = 0;

  void append(const void* data, std::size_t size);
  void seal();
};

/// Writes a prepared sequence into a hidden sibling folder and renames it when it is complete. The
/// destructor removes an unfinished one.
class SequenceWriter {
 public:
  SequenceWriter(std::filesystem::path folder, SequenceHeader header);
  ~SequenceWriter();
  SequenceWriter(const SequenceWriter&) = delete;
  SequenceWriter& operator=(const SequenceWriter&) = delete;

  /// Adds the next frame; T_wc is the true pose.
  void add(std::int64_t timestamp_ns, const FrameBlock& block, const SE3& T_wc);
  /// Adds another file to the folder. The caller must put its SHA-256 into `source`.
  void add_file(const std::string& name, const std::string& content);
  /// Completes the folder. source: value of `source` in sequence.json.
  void finish(const nlohmann::json& source);

 private:
  struct Entry {
    std::int64_t timestamp_ns;
    std::uint32_t crc32, flags;
  };

  std::filesystem::path folder_, partial_;
  SequenceHeader header_;
  std::size_t block_bytes_ = 0, stride_bytes_ = 0;
  std::ofstream frames_;
  std::string groundtruth_;
  std::vector<Entry> index_;
  std::vector<std::uint8_t> previous_;
  bool finished_ = false;
};

}  // namespace slambed::synth
