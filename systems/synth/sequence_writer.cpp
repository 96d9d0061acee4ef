// SPDX-License-Identifier: Apache-2.0
#include "synth/sequence_writer.hpp"

#include <unistd.h>
#include <zlib.h>

#include <cinttypes>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/error.hpp"
#include "base/files.hpp"
#include "synth/sha256.hpp"

namespace slambed::synth {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr std::size_t kAlignment_bytes = 4096;
constexpr std::uint32_t kDuplicate = 1;

template <typename Value>
void append_value(std::string& bytes, Value value) {
  for (std::size_t i = 0; i < sizeof(Value); ++i)
    bytes.push_back(static_cast<char>(static_cast<std::uint64_t>(value) >> (8 * i)));
}

std::string pose_line(double time_s, const SE3& T_wc) {
  Eigen::Quaterniond q(T_wc.R);
  q.normalize();
  char line[256];
  std::snprintf(line, sizeof line, "%.6f %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n", time_s, T_wc.t.x(),
                T_wc.t.y(), T_wc.t.z(), q.x(), q.y(), q.z(), q.w());
  return line;
}

}  // namespace

void FrameBlock::append(const void* data, std::size_t size) {
  const auto* first = static_cast<const std::uint8_t*>(data);
  bytes.insert(bytes.end(), first, first + size);
}

void FrameBlock::seal() {
  crc32 = static_cast<std::uint32_t>(::crc32(0, bytes.data(), static_cast<uInt>(bytes.size())));
}

SequenceWriter::SequenceWriter(fs::path folder, SequenceHeader header)
    : folder_(std::move(folder)), header_(std::move(header)) {
  const std::size_t pixels = static_cast<std::size_t>(header_.camera.width) * header_.camera.height;
  block_bytes_ = pixels * (header_.sensor == "rgbd" ? 3 : header_.sensor == "stereo" ? 2 : 1);
  stride_bytes_ = (block_bytes_ + kAlignment_bytes - 1) / kAlignment_bytes * kAlignment_bytes;
  partial_ = folder_.parent_path() /
             ("." + folder_.filename().string() + ".partial-" + std::to_string(getpid()));
  std::error_code refused;
  fs::remove_all(partial_, refused);
  fs::create_directories(partial_, refused);
  frames_.open(partial_ / "frames.bin", std::ios::binary);
  if (!frames_)
    throw environment_error(partial_.string() + " cannot be written; choose another --out");
  groundtruth_ = "# timestamp tx ty tz qx qy qz qw (camera to world)\n";
}

SequenceWriter::~SequenceWriter() {
  if (finished_) return;
  frames_.close();
  std::error_code ignored;
  fs::remove_all(partial_, ignored);
}

void SequenceWriter::add(std::int64_t timestamp_ns, const FrameBlock& block, const SE3& T_wc) {
  static const std::vector<char> kZeros(kAlignment_bytes, 0);
  frames_.write(reinterpret_cast<const char*>(block.bytes.data()),
                static_cast<std::streamsize>(block.bytes.size()));
  frames_.write(kZeros.data(), static_cast<std::streamsize>(stride_bytes_ - block_bytes_));
  if (!frames_)
    throw environment_error((partial_ / "frames.bin").string() +
                            " cannot be written; is the disk full?");
  index_.push_back({timestamp_ns, block.crc32, block.bytes == previous_ ? kDuplicate : 0});
  previous_ = block.bytes;
  groundtruth_ += pose_line(header_.time_origin_s + static_cast<double>(timestamp_ns) * 1e-9, T_wc);
}

void SequenceWriter::add_file(const std::string& name, const std::string& content) {
  write_whole(partial_ / name, content);
}

void SequenceWriter::finish(const json& source) {
  frames_.close();
  if (!frames_) throw environment_error(partial_.string() + ": write failed; is the disk full?");
  std::string index;
  for (const Entry& entry : index_) {
    append_value(index, entry.timestamp_ns);
    append_value(index, entry.crc32);
    append_value(index, entry.flags);
  }
  write_whole(partial_ / "index.bin", index);
  write_whole(partial_ / "groundtruth.txt", groundtruth_);
  const Camera& c = header_.camera;
  json header = {
      {"format", "slambed-sequence"},
      {"version", 1},
      {"id", header_.id},
      {"title", header_.title},
      {"sensor", header_.sensor},
      {"width", c.width},
      {"height", c.height},
      {"frames", index_.size()},
      {"frame_stride_bytes", stride_bytes_},
      {"fps", header_.fps},
      {"camera",
       {{"fx", c.fx},
        {"fy", c.fy},
        {"cx", c.cx},
        {"cy", c.cy},
        {"bf", c.bf},
        {"distortion", c.distortion}}},
      {"depth_unit_m", header_.depth_unit_m},
      {"close_depth_baselines", header_.close_depth_baselines},
      {"time_origin_s", header_.time_origin_s},
  };
  header["checksum"] = sha256_hex(index + header.dump());
  header["source"] = source;
  write_whole(partial_ / "sequence.json", header.dump(2) + "\n");
  std::error_code refused;
  fs::remove_all(folder_, refused);
  fs::rename(partial_, folder_, refused);
  if (refused)
    throw environment_error(folder_.string() + ": " + refused.message() + "; choose another --out");
  finished_ = true;
}

}  // namespace slambed::synth
