// SPDX-License-Identifier: Apache-2.0
#include "wire/feature_codec.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

#include "base/error.hpp"

namespace slambed::wire {
namespace {

constexpr double kMarginPx = 32;  ///< undistortion may move a key point out of the bounds
constexpr double kSteps = 65535;
constexpr int kAngleBits = 12;
constexpr int kAngleSteps = 1 << kAngleBits;
constexpr int kMantissaBits = 12;
constexpr int kFloatMantissaBits = 23;
constexpr float kMinDepth = 0.0625f, kMaxDepth = 4096.f;
/// The float bits of kMinDepth, cut to the mantissa bits that we keep, less 1: code 0 is "no
/// depth".
constexpr std::uint32_t kDepthBase =
    (std::bit_cast<std::uint32_t>(kMinDepth) >> (kFloatMantissaBits - kMantissaBits)) - 1;

/// Maps one axis of the undistorted image, with a margin, onto 16 bits.
struct Axis {
  double origin, step;
  Axis(double low, double high)
      : origin(low - kMarginPx), step((high - low + 2 * kMarginPx) / kSteps) {}
  std::uint16_t quantize(float value) const {
    return static_cast<std::uint16_t>(
        std::clamp(std::floor((value - origin) / step + 0.5), 0.0, kSteps));
  }
  float restore(std::uint16_t code) const { return static_cast<float>(origin + code * step); }
};

}  // namespace

std::uint16_t quantize_depth(float depth_m) {
  if (!(depth_m >= kMinDepth && depth_m < kMaxDepth)) return 0;
  constexpr int kDropped = kFloatMantissaBits - kMantissaBits;
  const std::uint32_t bits = std::bit_cast<std::uint32_t>(depth_m);
  const std::uint32_t rounded = (bits + (1u << (kDropped - 1))) >> kDropped;
  return static_cast<std::uint16_t>(std::min<std::uint32_t>(rounded - kDepthBase, UINT16_MAX));
}

float restore_depth(std::uint16_t code) {
  if (code == 0) return -1;
  return std::bit_cast<float>((code + kDepthBase) << (kFloatMantissaBits - kMantissaBits));
}

KeyPoint as_received(const KeyPoint& point, const Sensor& sensor) {
  const Axis columns(sensor.bounds.min_x, sensor.bounds.max_x);
  const Axis rows(sensor.bounds.min_y, sensor.bounds.max_y);
  KeyPoint received = point;
  received.u = columns.restore(columns.quantize(point.u));
  received.v = rows.restore(rows.quantize(point.v));
  received.depth_m = restore_depth(quantize_depth(point.depth_m));
  return received;
}

void put_features(ByteWriter& out, const FeatureSet& features) {
  const Sensor& sensor = features.sensor();
  const Axis columns(sensor.bounds.min_x, sensor.bounds.max_x);
  const Axis rows(sensor.bounds.min_y, sensor.bounds.max_y);
  const auto count = static_cast<std::size_t>(features.size());
  if (count > kMaxFeatures) {
    throw Error(ExitCode::kInternal, "wire: too many features in one keyframe");
  }
  out.reserve(count * kFeatureBytes + 8);
  out.varint(count);
  for (std::size_t i = 0; i < count; ++i) {
    const KeyPoint& point = features.keypoints()[i];
    const int angle =
        static_cast<int>(std::lround(point.angle_deg * (kAngleSteps / 360.f))) & (kAngleSteps - 1);
    out.u16(columns.quantize(point.u));
    out.u16(rows.quantize(point.v));
    out.u16(quantize_depth(point.depth_m));
    out.u16(static_cast<std::uint16_t>(point.octave << kAngleBits | angle));
    for (const std::uint64_t word : features.descriptors()[i]) out.u64(word);
  }
}

std::shared_ptr<const FeatureSet> get_features(ByteReader& in,
                                               std::shared_ptr<const Sensor> sensor) {
  const Axis columns(sensor->bounds.min_x, sensor->bounds.max_x);
  const Axis rows(sensor->bounds.min_y, sensor->bounds.max_y);
  const std::size_t count = in.count(kFeatureBytes);
  if (count > kMaxFeatures) throw DecodeError("too many features");
  std::vector<KeyPoint> keypoints(count);
  std::vector<Descriptor> descriptors(count);
  const int levels = sensor->pyramid.levels();
  const auto bf = static_cast<float>(sensor->camera.bf);
  for (std::size_t i = 0; i < count; ++i) {
    KeyPoint& point = keypoints[i];
    point.u = columns.restore(in.u16());
    point.v = rows.restore(in.u16());
    point.depth_m = restore_depth(in.u16());
    if (point.has_depth()) point.right_u = point.u - bf / point.depth_m;
    const std::uint16_t packed = in.u16();
    point.octave = static_cast<std::uint8_t>(packed >> kAngleBits);
    if (point.octave >= levels) throw DecodeError("octave is out of range");
    point.angle_deg = static_cast<float>(packed & (kAngleSteps - 1)) * (360.f / kAngleSteps);
    for (std::uint64_t& word : descriptors[i]) word = in.u64();
  }
  return std::make_shared<const FeatureSet>(std::move(sensor), std::move(keypoints),
                                            std::move(descriptors));
}

}  // namespace slambed::wire
