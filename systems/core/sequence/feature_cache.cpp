// SPDX-License-Identifier: Apache-2.0
#include "sequence/feature_cache.hpp"

#include <cstring>
#include <vector>

namespace slambed {
namespace {

constexpr std::size_t kKeyPointBytes = 24, kDescriptorBytes = 32;

/// A KeyPoint with a fixed layout, independent of the compiler's padding.
struct StoredKeyPoint {
  float u, v, right_u, depth_m, angle_deg;
  std::uint32_t octave;
};
static_assert(sizeof(StoredKeyPoint) == kKeyPointBytes);
static_assert(sizeof(Descriptor) == kDescriptorBytes);

FrameFile::OwnedBlock stored(const FeatureSet& features) {
  const auto count = static_cast<std::size_t>(features.size());
  std::vector<std::uint8_t> bytes(count * (kKeyPointBytes + kDescriptorBytes));
  std::uint8_t* at = bytes.data();
  for (const KeyPoint& k : features.keypoints()) {
    const StoredKeyPoint point{k.u, k.v, k.right_u, k.depth_m, k.angle_deg, k.octave};
    std::memcpy(at, &point, sizeof point);
    at += sizeof point;
  }
  if (count > 0) std::memcpy(at, features.descriptors().data(), count * kDescriptorBytes);
  return {static_cast<std::uint32_t>(count), std::move(bytes)};
}

}  // namespace

FeatureCache::FeatureCache(const std::filesystem::path& path, const std::string& key,
                           std::uint64_t frames, FeatureSource& source)
    : sensor_(source.sensor()),
      file_({.name = "feature cache", .magic = 0x43464C53, .version = 1}, path, frames) {  // "SLFC"
  file_.open_or_make(key, [&](std::uint64_t frame) { return stored(*source.features(frame)); });
}

std::shared_ptr<const FeatureSet> FeatureCache::features(std::uint64_t frame) {
  const FrameFile::Block block = file_.block(frame);
  const std::size_t count = block.count;
  if (block.bytes.size() != count * (kKeyPointBytes + kDescriptorBytes))
    file_.refuse(frame, "is damaged");
  std::vector<KeyPoint> keypoints(count);
  for (std::size_t i = 0; i < count; ++i) {
    StoredKeyPoint point{};
    std::memcpy(&point, block.bytes.data() + i * kKeyPointBytes, sizeof point);
    keypoints[i] = {point.u,       point.v,         point.right_u,
                    point.depth_m, point.angle_deg, static_cast<std::uint8_t>(point.octave)};
  }
  std::vector<Descriptor> descriptors(count);
  if (count > 0) {
    std::memcpy(descriptors.data(), block.bytes.data() + count * kKeyPointBytes,
                count * kDescriptorBytes);
  }
  return std::make_shared<FeatureSet>(sensor_, std::move(keypoints), std::move(descriptors));
}

}  // namespace slambed
