// SPDX-License-Identifier: Apache-2.0
#include "wire/point_codec.hpp"

#include <algorithm>
#include <cmath>

#include "map/appearance.hpp"
#include "wire/feature_codec.hpp"

namespace slambed::wire {
namespace {

enum Flags : std::uint8_t {
  kNamedDescriptor = 1,   ///< keyframe index and feature index replace the 32 bytes
  kFirstIsReference = 2,  ///< first_keyframe equals reference and is omitted
  kReferenceIsNamed = 4,  ///< reference is the keyframe that the descriptor refers to
  kNearestDerived = 8,    ///< min_distance is computed from max_distance and the pyramid
  kFresh = 16,            ///< only the id follows: the rest is computed from the feature
  kAllFlags = 31,
};

/// Smallest size of a fresh point (flags, id) and of any other (also position, normal, distance,
/// two counters and a version).
constexpr std::size_t kFreshBytes = 2;
constexpr std::size_t kOtherBytes = kFreshBytes + 12 + 6 + 4 + 3;

/// Largest distance of a fresh point from the point that its quantized feature gives, relative to
/// its distance from the camera. Most of it comes from the 12-bit mantissa of the depth.
constexpr double kFreshTolerance = 2e-4;

bool is_near(float a, float b) {
  return std::abs(a - b) <= static_cast<float>(kFreshTolerance) * std::abs(b);
}

constexpr float kNormalSteps = 32767;

std::uint16_t quantize_normal(float value) {
  return static_cast<std::uint16_t>(
      static_cast<std::int16_t>(std::lround(std::clamp(value, -1.f, 1.f) * kNormalSteps)));
}

float restore_normal(std::uint16_t code) {
  return static_cast<float>(static_cast<std::int16_t>(code)) / kNormalSteps;
}

}  // namespace

PointCodec::PointCodec(const std::vector<NewKeyFrame>& keyframes, FreshPoints fresh)
    : keyframes_(keyframes), fresh_(fresh) {}

const std::vector<PointCodec::PointObservation>& PointCodec::observations() {
  if (observations_.empty()) {
    for (std::uint32_t k = 0; k < keyframes_.size(); ++k) {
      const auto& points = keyframes_[k].points;
      for (std::uint32_t feature = 0; feature < points.size(); ++feature) {
        if (points[feature]) observations_.push_back({points[feature].value, k, feature});
      }
    }
    std::sort(observations_.begin(), observations_.end());
  }
  return observations_;
}

const PointCodec::PointObservation* PointCodec::find_descriptor(const NewPoint& point) {
  const auto& all = observations();
  for (auto at = std::lower_bound(all.begin(), all.end(), PointObservation{point.id.value, 0, 0});
       at != all.end() && at->point == point.id.value; ++at) {
    const auto& features = *keyframes_[at->keyframe].features;
    if (features.descriptors()[at->feature] == point.appearance.descriptor) return &*at;
  }
  return nullptr;
}

std::optional<PointCodec::Fresh> PointCodec::fresh(MapPointId id) {
  const auto& all = observations();
  const auto seen = std::lower_bound(all.begin(), all.end(), PointObservation{id.value, 0, 0});
  if (seen == all.end() || seen->point != id.value) return std::nullopt;
  const NewKeyFrame& keyframe = keyframes_[seen->keyframe];
  const FeatureSet& features = *keyframe.features;
  const int feature = static_cast<int>(seen->feature);
  const KeyPoint received = as_received(features.keypoint(feature), features.sensor());
  if (!received.has_depth()) return std::nullopt;
  const Eigen::Vector3d p_c =
      features.sensor().camera.unproject(received.u, received.v, received.depth_m);
  Fresh made{.point = {}, .distance_m = p_c.norm()};
  NewPoint& point = made.point;
  point.id = id;
  point.p_w = keyframe.T_cw.inverse() * p_c;
  point.appearance = appearance_of(point.p_w, keyframe.T_cw, features, feature);
  point.reference = point.first_keyframe = keyframe.id;
  // If a received pose is extremely far away, the distance vanishes in rounding.
  const float farthest_m = point.appearance.max_distance_m;
  if (!(farthest_m > 0) || !std::isfinite(farthest_m)) return std::nullopt;
  return made;
}

bool PointCodec::is_fresh(const NewPoint& point) {
  if (fresh_ == FreshPoints::kWhole) return false;
  if (point.visible != 1 || point.found != 1 || point.version != 0) return false;
  const auto derived = fresh(point.id);
  if (!derived) return false;
  const Appearance &look = point.appearance, &like = derived->point.appearance;
  return point.reference == derived->point.reference &&
         point.first_keyframe == derived->point.first_keyframe &&
         look.descriptor == like.descriptor &&
         (point.p_w - derived->point.p_w).norm() <= kFreshTolerance * derived->distance_m &&
         (look.normal - like.normal).norm() < kFreshTolerance &&
         is_near(look.max_distance_m, like.max_distance_m) &&
         is_near(look.min_distance_m, like.min_distance_m);
}

/// ORB-SLAM2's rule: the minimum distance is the maximum distance divided by the scale of the
/// coarsest pyramid level.
float PointCodec::nearest_from(float max_distance_m) const {
  if (keyframes_.empty()) return -1;
  return max_distance_m / keyframes_.front().features->sensor().pyramid.scale.back();
}

void PointCodec::put(ByteWriter& out, IdStream& ids, const NewPoint& point) {
  if (is_fresh(point)) {
    out.u8(kFresh);
    return ids.put(out, point.id);
  }
  const Appearance& look = point.appearance;
  const PointObservation* named = find_descriptor(point);
  std::uint8_t flags = 0;
  if (named) flags |= kNamedDescriptor;
  if (named && keyframes_[named->keyframe].id == point.reference) flags |= kReferenceIsNamed;
  if (point.first_keyframe == point.reference) flags |= kFirstIsReference;
  if (look.min_distance_m == nearest_from(look.max_distance_m)) flags |= kNearestDerived;
  out.u8(flags);
  ids.put(out, point.id);
  for (const double value : point.p_w) out.f32(static_cast<float>(value));
  for (const float value : look.normal) out.u16(quantize_normal(value));
  out.f32(look.max_distance_m);
  if (!(flags & kNearestDerived)) out.f32(look.min_distance_m);
  if (named) {
    out.varint(named->keyframe);
    out.varint(named->feature);
  } else {
    for (const std::uint64_t word : look.descriptor) out.u64(word);
  }
  IdStream keyframes;  // a new stream for each point, because few points need it
  if (!(flags & kReferenceIsNamed)) keyframes.put(out, point.reference);
  if (!(flags & kFirstIsReference)) keyframes.put(out, point.first_keyframe);
  out.varint(point.visible);
  out.varint(point.found);
  out.varint(point.version);
}

std::size_t PointCodec::get_count(ByteReader& in) {
  const std::size_t count = in.count(kFreshBytes);
  // Each fresh point needs an observing feature, so a short message cannot claim much memory.
  if (count > observations().size() + in.remaining() / kOtherBytes) {
    throw DecodeError("more points than there can be");
  }
  return count;
}

NewPoint PointCodec::get(ByteReader& in, IdStream& ids) {
  NewPoint point;
  Appearance& look = point.appearance;
  const std::uint8_t flags = in.u8();
  if (flags & ~kAllFlags) throw DecodeError("unknown point flags");
  if (flags & kFresh) {
    if (flags != kFresh) throw DecodeError("fresh point with other flags");
    auto derived = fresh(ids.get<MapPointId>(in));
    if (!derived) throw DecodeError("fresh point without a feature that has depth");
    return derived->point;
  }
  if ((flags & kReferenceIsNamed) && !(flags & kNamedDescriptor)) {
    throw DecodeError("reference keyframe is not named");
  }
  point.id = ids.get<MapPointId>(in);
  for (double& value : point.p_w) value = in.f32();
  for (float& value : look.normal) value = restore_normal(in.u16());
  look.max_distance_m = in.f32();
  if (look.max_distance_m < 0) throw DecodeError("distance is negative");
  if (flags & kNearestDerived) {
    if (keyframes_.empty()) throw DecodeError("distance cannot be derived");
    look.min_distance_m = nearest_from(look.max_distance_m);
  } else {
    look.min_distance_m = in.f32();
    if (look.min_distance_m < 0) throw DecodeError("distance is negative");
  }
  const NewKeyFrame* named = nullptr;
  if (flags & kNamedDescriptor) {
    const std::uint32_t k = in.varint32(), feature = in.varint32();
    if (k >= keyframes_.size()) throw DecodeError("descriptor names an unknown keyframe");
    named = &keyframes_[k];
    if (feature >= named->points.size()) throw DecodeError("descriptor names an unknown feature");
    look.descriptor = named->features->descriptors()[feature];
  } else {
    for (std::uint64_t& word : look.descriptor) word = in.u64();
  }
  IdStream keyframes;
  point.reference = flags & kReferenceIsNamed ? named->id : keyframes.get_or_none<KeyFrameId>(in);
  point.first_keyframe =
      flags & kFirstIsReference ? point.reference : keyframes.get_or_none<KeyFrameId>(in);
  point.visible = in.varint32();
  point.found = in.varint32();
  point.version = in.varint32();
  return point;
}

}  // namespace slambed::wire
