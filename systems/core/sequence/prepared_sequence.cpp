// SPDX-License-Identifier: Apache-2.0
#include "sequence/prepared_sequence.hpp"

#include <bit>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>

#include "base/error.hpp"
#include "base/fd.hpp"
#include "base/json_reader.hpp"
#include "runtime/frame_header.hpp"

namespace slambed {
namespace {

static_assert(std::endian::native == std::endian::little, "frames.bin is mapped, not converted");

constexpr std::size_t kPage = 4096;
constexpr std::int64_t kMaxSide = 1 << 14;
constexpr std::int64_t kMaxFrames = 1 << 24;
constexpr std::size_t kIndexEntry = 16;  ///< int64 time, uint32 checksum, uint32 flags

/// Rounds to microseconds: recorded times in seconds have hardly more digits, nor has a double.
std::int64_t to_ns(double seconds) { return std::llround(seconds * 1e6) * 1000; }

SensorKind sensor_kind(JsonReader& in) {
  const std::string name = in.text("sensor");
  for (const SensorKind kind : {SensorKind::kRgbd, SensorKind::kStereo, SensorKind::kMono})
    if (name == sensor_name(kind)) return kind;
  in.fail("sensor", "is '" + name + "', not rgbd, stereo or mono");
}

constexpr std::size_t bytes_per_pixel(SensorKind kind) {
  return kind == SensorKind::kRgbd ? 3 : kind == SensorKind::kStereo ? 2 : 1;
}

}  // namespace

const char* sensor_name(SensorKind kind) {
  switch (kind) {
    case SensorKind::kStereo:
      return "stereo";
    case SensorKind::kMono:
      return "mono";
    case SensorKind::kRgbd:
      break;
  }
  return "rgbd";
}

PreparedSequence::PreparedSequence(std::filesystem::path folder) : folder_(std::move(folder)) {
  read_header();
  read_index();
  map_frames();
  verify(0);
}

void PreparedSequence::read_header() {
  const auto path = folder_ / "sequence.json";
  const nlohmann::json json = read_json(path);
  JsonReader in(json, path.string() + ": ");
  if (in.text("format") != "slambed-sequence") in.fail("format", "must be 'slambed-sequence'");
  in.integer("version", 1, 1);
  id_ = in.text("id");
  sensor_ = sensor_kind(in);
  camera_.width = static_cast<int>(in.integer("width", 1, kMaxSide));
  camera_.height = static_cast<int>(in.integer("height", 1, kMaxSide));
  const bool rgbd = sensor_ == SensorKind::kRgbd;
  // Blocks are page-aligned. A gray plane of even size keeps the 16-bit depth plane aligned too.
  if (rgbd && camera_.width * camera_.height % 2 != 0)
    in.fail("width", "times height must be even");
  frame_count_ = static_cast<std::uint64_t>(in.integer("frames", 1, kMaxFrames));
  stride_bytes_ = static_cast<std::size_t>(in.integer("frame_stride_bytes", 1, INT32_MAX));
  if (stride_bytes_ % kPage != 0 || stride_bytes_ < block_bytes()) {
    in.fail("frame_stride_bytes", "must be a multiple of 4096 that holds one frame");
  }
  fps_ = in.number("fps");
  if (fps_ <= 0) in.fail("fps", "must be above 0");
  depth_unit_m_ = in.number("depth_unit_m");
  if (rgbd && depth_unit_m_ <= 0) in.fail("depth_unit_m", "must be above 0");
  close_depth_baselines_ = in.number("close_depth_baselines");
  if (close_depth_baselines_ <= 0) in.fail("close_depth_baselines", "must be above 0");
  time_origin_ns_ = to_ns(in.number("time_origin_s"));

  JsonReader lens(in.any("camera"), path.string() + ": camera.");
  camera_.fx = lens.number("fx");
  camera_.fy = lens.number("fy");
  camera_.cx = lens.number("cx");
  camera_.cy = lens.number("cy");
  camera_.bf = lens.number("bf");
  if (camera_.fx <= 0 || camera_.fy <= 0) lens.fail("fx", "and fy must be above 0");
  if (sensor_ == SensorKind::kMono)
    camera_.bf = 0;
  else if (camera_.bf <= 0)
    lens.fail("bf", "must be above 0");
  const auto& distortion = lens.any("distortion");
  if (!distortion.is_array() || distortion.size() != camera_.distortion.size()) {
    lens.fail("distortion", "must be [k1, k2, p1, p2, k3]");
  }
  for (std::size_t i = 0; i < distortion.size(); ++i) {
    if (!distortion[i].is_number()) lens.fail("distortion", "must be [k1, k2, p1, p2, k3]");
    camera_.distortion[i] = distortion[i].get<double>();
  }
}

std::size_t PreparedSequence::block_bytes() const {
  return bytes_per_pixel(sensor_) * static_cast<std::size_t>(camera_.width) *
         static_cast<std::size_t>(camera_.height);
}

void PreparedSequence::read_index() {
  const auto path = folder_ / "index.bin";
  std::ifstream file(path, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), {});
  if (!file.is_open() || bytes.size() != frame_count_ * kIndexEntry) {
    throw bad_input(path.string() + ": has " + std::to_string(bytes.size()) + " bytes, not " +
                    std::to_string(frame_count_ * kIndexEntry) + "; prepare the sequence again");
  }
  for (std::uint64_t i = 0; i < frame_count_; ++i) {
    std::int64_t timestamp = 0;
    std::uint32_t crc = 0;
    std::memcpy(&timestamp, &bytes[i * kIndexEntry], sizeof timestamp);
    std::memcpy(&crc, &bytes[i * kIndexEntry + sizeof timestamp], sizeof crc);
    if (!timestamps_ns_.empty() && timestamp <= timestamps_ns_.back()) {
      throw bad_input(path.string() + ": time does not increase at frame " + std::to_string(i) +
                      "; prepare the sequence again");
    }
    timestamps_ns_.push_back(timestamp);
    checksums_.push_back(crc);
  }
}

void PreparedSequence::map_frames() {
  const auto path = folder_ / "frames.bin";
  file_ = MappedFile::open(path);
  if (!file_ && errno == ENOMEM) {
    throw environment_error(path.string() + ": cannot be mapped: " + error_text(errno) +
                            "; raise the limit of address space");
  }
  if (!file_) {
    throw bad_input(path.string() + ": " + error_text(errno) + "; prepare the sequence again");
  }
  const std::uint64_t size = file_.bytes().size();
  if (size != frame_count_ * stride_bytes_) {
    throw bad_input(path.string() + ": has " + std::to_string(size) + " bytes, not " +
                    std::to_string(frame_count_ * stride_bytes_) + "; prepare the sequence again");
  }
  data_ = file_.bytes().data();
  file_.read_ahead();
}

PreparedSequence::Frame PreparedSequence::frame(std::uint64_t index) const {
  const std::uint8_t* block = data_ + index * stride_bytes_;
  const std::uint8_t* second =
      block + static_cast<std::size_t>(camera_.width) * static_cast<std::size_t>(camera_.height);
  Frame frame;
  frame.index = index;
  frame.timestamp_ns = timestamps_ns_[index];
  frame.gray = {block, camera_.width, camera_.height, camera_.width};
  if (sensor_ == SensorKind::kRgbd)
    frame.depth = {reinterpret_cast<const std::uint16_t*>(second), camera_.width, camera_.height,
                   camera_.width};
  if (sensor_ == SensorKind::kStereo)
    frame.right = {second, camera_.width, camera_.height, camera_.width};
  return frame;
}

void PreparedSequence::verify(std::uint64_t index) const {
  if (checksum({data_ + index * stride_bytes_, block_bytes()}) != checksums_[index]) {
    throw bad_input((folder_ / "frames.bin").string() + ": frame " + std::to_string(index) +
                    " is damaged; prepare the sequence again");
  }
}

void PreparedSequence::verify_all() const {
  for (std::uint64_t i = 0; i < frame_count_; ++i) verify(i);
}

}  // namespace slambed
