// SPDX-License-Identifier: Apache-2.0
#include "node/feature_cache.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <cstring>
#include <fstream>
#include <vector>

#include "base/error.hpp"

namespace slambed {
namespace {

constexpr std::uint32_t kMagic = 0x43464C53;  // "SLFC"
constexpr std::uint32_t kVersion = 1;
constexpr std::size_t kHeaderBytes = 20;
constexpr std::size_t kKeyPointBytes = 24, kDescriptorBytes = 32;

/// KeyPoint without the compiler's own idea of padding.
struct StoredKeyPoint {
  float u, v, right_u, depth_m, angle_deg;
  std::uint32_t octave;
};
static_assert(sizeof(StoredKeyPoint) == kKeyPointBytes);
static_assert(sizeof(Descriptor) == kDescriptorBytes);

template <typename T>
T read_at(std::span<const std::uint8_t> bytes, std::size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

template <typename T>
void append(std::vector<std::uint8_t>& bytes, const T* values, std::size_t count) {
  const std::size_t at = bytes.size();
  bytes.resize(at + count * sizeof(T));
  if (count > 0) std::memcpy(bytes.data() + at, values, count * sizeof(T));
}

std::vector<std::uint8_t> stored(const FeatureSet& features) {
  std::vector<std::uint8_t> body;
  for (const KeyPoint& k : features.keypoints()) {
    const StoredKeyPoint point{k.u, k.v, k.right_u, k.depth_m, k.angle_deg, k.octave};
    append(body, &point, 1);
  }
  append(body, features.descriptors().data(), features.descriptors().size());
  const std::uint32_t head[2] = {
      static_cast<std::uint32_t>(features.size()),
      static_cast<std::uint32_t>(::crc32_z(0, body.data(), body.size()))};
  std::vector<std::uint8_t> block;
  append(block, head, 2);
  append(block, body.data(), body.size());
  return block;
}

void make(const std::filesystem::path& path, const std::string& key, std::uint64_t frames,
          FeatureSource& source) {
  const std::filesystem::path part = path.string() + "." + std::to_string(::getpid());
  std::ofstream file(part, std::ios::binary);
  std::vector<std::uint8_t> head;
  const std::uint32_t magic[2] = {kMagic, kVersion};
  const auto key_length = static_cast<std::uint32_t>(key.size());
  append(head, magic, 2);
  append(head, &frames, 1);
  append(head, &key_length, 1);
  append(head, key.data(), key.size());
  head.resize((head.size() + 7) / 8 * 8);
  std::vector<std::uint64_t> offsets{head.size() + (frames + 1) * sizeof(std::uint64_t)};
  file.seekp(static_cast<std::streamoff>(offsets.front()));
  for (std::uint64_t frame = 0; frame < frames && file; ++frame) {
    const auto block = stored(*source.features(frame));
    file.write(reinterpret_cast<const char*>(block.data()),
               static_cast<std::streamsize>(block.size()));
    offsets.push_back(offsets.back() + block.size());
  }
  append(head, offsets.data(), offsets.size());
  file.seekp(0);
  file.write(reinterpret_cast<const char*>(head.data()), static_cast<std::streamsize>(head.size()));
  file.close();
  std::error_code error;
  if (file) std::filesystem::rename(part, path, error);
  if (!file || error) {
    std::filesystem::remove(part, error);
    throw environment_error("feature cache " + path.string() +
                            ": cannot be written; check the folder's rights and free space");
  }
}

}  // namespace

FeatureCache::FeatureCache(const std::filesystem::path& path, const std::string& key,
                           const PreparedSequence& sequence, std::shared_ptr<const Sensor> sensor,
                           const OrbOptions& options)
    : path_(path), sensor_(std::move(sensor)), frames_(sequence.frames()) {
  if (open(key)) return;
  ExtractingSource source(sequence, sensor_, options);
  make(path_, key, frames_, source);
  if (!open(key)) {
    throw environment_error("feature cache " + path_.string() + ": cannot be read back; remove it");
  }
}

FeatureCache::~FeatureCache() { close(); }

void FeatureCache::close() {
  if (file_.data()) ::munmap(const_cast<std::uint8_t*>(file_.data()), file_.size());
  file_ = {};
}

bool FeatureCache::open(const std::string& key) {
  const int fd = ::open(path_.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return false;
  struct stat status {};
  void* data = MAP_FAILED;
  std::size_t size = 0;
  if (::fstat(fd, &status) == 0 && status.st_size > 0) {
    size = static_cast<std::size_t>(status.st_size);
    data = ::mmap(nullptr, size, PROT_READ, MAP_SHARED, fd, 0);
  }
  ::close(fd);
  if (data == MAP_FAILED) return false;
  file_ = {static_cast<const std::uint8_t*>(data), size};
  offsets_at_ = (kHeaderBytes + key.size() + 7) / 8 * 8;
  const std::size_t table_bytes = (frames_ + 1) * sizeof(std::uint64_t);
  const bool good =
      size >= offsets_at_ + table_bytes && read_at<std::uint32_t>(file_, 0) == kMagic &&
      read_at<std::uint32_t>(file_, 4) == kVersion && read_at<std::uint64_t>(file_, 8) == frames_ &&
      read_at<std::uint32_t>(file_, 16) == key.size() &&
      std::memcmp(file_.data() + kHeaderBytes, key.data(), key.size()) == 0 &&
      offset(frames_) == size;
  if (!good) close();
  return good;
}

std::uint64_t FeatureCache::offset(std::uint64_t frame) const {
  return read_at<std::uint64_t>(file_, offsets_at_ + frame * sizeof(std::uint64_t));
}

std::shared_ptr<const FeatureSet> FeatureCache::features(std::uint64_t frame) {
  const auto damaged = [&] {
    return bad_input("feature cache " + path_.string() + ": frame " + std::to_string(frame) +
                     " is damaged; remove the file, it is made anew");
  };
  const std::uint64_t begin = offset(frame), end = offset(frame + 1);
  if (end < begin || end > file_.size() || end - begin < 8) throw damaged();
  const std::size_t count = read_at<std::uint32_t>(file_, begin);
  const auto body = file_.subspan(begin + 8, end - begin - 8);
  if (body.size() != count * (kKeyPointBytes + kDescriptorBytes) ||
      ::crc32_z(0, body.data(), body.size()) != read_at<std::uint32_t>(file_, begin + 4)) {
    throw damaged();
  }
  std::vector<KeyPoint> keypoints(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto stored = read_at<StoredKeyPoint>(body, i * kKeyPointBytes);
    keypoints[i] = {stored.u,       stored.v,         stored.right_u,
                    stored.depth_m, stored.angle_deg, static_cast<std::uint8_t>(stored.octave)};
  }
  std::vector<Descriptor> descriptors(count);
  if (count > 0) {
    std::memcpy(descriptors.data(), body.data() + count * kKeyPointBytes, count * kDescriptorBytes);
  }
  return std::make_shared<FeatureSet>(sensor_, std::move(keypoints), std::move(descriptors));
}

}  // namespace slambed
