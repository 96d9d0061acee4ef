// SPDX-License-Identifier: Apache-2.0
#include "wire/mask_codec.hpp"

#include <algorithm>
#include <cmath>

namespace slambed::wire {
namespace {

constexpr float kStepsPerPixel = 8;
/// Key points may lie outside the image, but no farther than this.
constexpr float kFarthest_px = 1e6f;
constexpr std::size_t kLeastInstanceBytes = 9;

constexpr std::uint8_t kMoves = 1, kHasBody = 2;

std::int64_t steps(float pixel) {
  return std::llround(std::clamp(pixel, -kFarthest_px, kFarthest_px) * kStepsPerPixel);
}

float pixel(ByteReader& in) {
  const float at = static_cast<float>(in.zigzag()) / kStepsPerPixel;
  if (!(std::abs(at) <= kFarthest_px)) throw DecodeError("masks: a key point is far outside");
  return at;
}

void put_instance(ByteWriter& out, const Instance& instance) {
  out.varint(instance.object_class);
  out.u8(static_cast<std::uint8_t>((instance.moves ? kMoves : 0) | (instance.body ? kHasBody : 0)));
  out.f32(instance.score);
  if (instance.body) {
    for (const BodyPoint& point : *instance.body) {
      out.zigzag(steps(point.u));
      out.zigzag(steps(point.v));
      out.u8(static_cast<std::uint8_t>(point.visibility));
    }
  }
  out.varint(instance.runs.size());
  for (std::size_t i = 0; i < instance.runs.size(); ++i) {
    const std::int64_t before = i < 2 ? 0 : instance.runs[i - 2];
    out.zigzag(std::int64_t{instance.runs[i]} - before);
  }
}

Instance get_instance(ByteReader& in, std::uint64_t pixels) {
  Instance instance;
  instance.object_class = static_cast<std::uint16_t>(in.varint32());
  const std::uint8_t flags = in.u8();
  if (flags > (kMoves | kHasBody)) throw DecodeError("masks: unknown flags");
  instance.moves = (flags & kMoves) != 0;
  instance.score = in.f32();
  if ((flags & kHasBody) != 0) {
    instance.body.emplace();
    for (BodyPoint& point : *instance.body) {
      point.u = pixel(in);
      point.v = pixel(in);
      point.visibility = static_cast<BodyPoint::Visibility>(in.u8());
    }
  }
  instance.runs.resize(in.count(1));
  for (std::size_t i = 0; i < instance.runs.size(); ++i) {
    const std::int64_t before = i < 2 ? 0 : instance.runs[i - 2];
    const std::int64_t difference = in.zigzag();
    if (difference < -before || difference > static_cast<std::int64_t>(pixels) - before)
      throw DecodeError("masks: a run is longer than the picture");
    instance.runs[i] = static_cast<std::uint32_t>(before + difference);
  }
  return instance;
}

FrameMasks checked(FrameMasks masks) {
  if (const std::string wrong = defect(masks); !wrong.empty()) throw DecodeError("masks: " + wrong);
  return masks;
}

Instance get_plain_instance(ByteReader& in) {
  Instance instance;
  instance.object_class = in.u16();
  const std::uint16_t flags = in.u16();
  if (flags > (kMoves | kHasBody)) throw DecodeError("masks: unknown flags");
  instance.moves = (flags & kMoves) != 0;
  instance.score = in.f32();
  const std::uint32_t runs = in.u32();
  if ((flags & kHasBody) != 0) {
    instance.body.emplace();
    for (BodyPoint& point : *instance.body) {
      point.u = in.f32();
      point.v = in.f32();
      const std::uint32_t visibility = in.u32();
      if (visibility > UINT8_MAX) throw DecodeError("masks: a key point's visibility is unknown");
      point.visibility = static_cast<BodyPoint::Visibility>(visibility);
    }
  }
  if (runs > in.remaining() / sizeof(std::uint32_t)) throw DecodeError("masks: runs are missing");
  instance.runs.resize(runs);
  for (std::uint32_t& run : instance.runs) run = in.u32();
  return instance;
}

}  // namespace

void put_masks(ByteWriter& out, const FrameMasks& masks) {
  out.varint(static_cast<std::uint64_t>(masks.width));
  out.varint(static_cast<std::uint64_t>(masks.height));
  out.varint(masks.instances.size());
  for (const Instance& instance : masks.instances) put_instance(out, instance);
}

FrameMasks get_masks(ByteReader& in, int width, int height) {
  const std::uint64_t found_width = in.varint(), found_height = in.varint();
  if (found_width != static_cast<std::uint64_t>(width) ||
      found_height != static_cast<std::uint64_t>(height))
    throw DecodeError("masks are of a picture of another size");
  FrameMasks masks{width, height, {}};
  const std::size_t count = in.count(kLeastInstanceBytes);
  if (count > FrameMasks::kMostInstances) throw DecodeError("masks: there are too many instances");
  for (std::size_t i = 0; i < count; ++i)
    masks.instances.push_back(
        get_instance(in, static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height)));
  return checked(std::move(masks));
}

Bytes encode_masks(const FrameMasks& masks) {
  ByteWriter out;
  put_masks(out, masks);
  return out.take();
}

FrameMasks decode_masks(std::span<const std::uint8_t> bytes, int width, int height) {
  ByteReader in(bytes);
  FrameMasks masks = get_masks(in, width, height);
  in.expect_end();
  return masks;
}

FrameMasks decode_segmentation(std::uint32_t instances, std::span<const std::uint8_t> bytes,
                               int width, int height) {
  ByteReader in(bytes);
  if (in.u32() != static_cast<std::uint32_t>(width) ||
      in.u32() != static_cast<std::uint32_t>(height))
    throw DecodeError("masks are of a picture of another size");
  if (instances > FrameMasks::kMostInstances)
    throw DecodeError("masks: there are too many instances");
  FrameMasks masks{width, height, {}};
  for (std::uint32_t i = 0; i < instances; ++i) masks.instances.push_back(get_plain_instance(in));
  in.expect_end();
  return checked(std::move(masks));
}

Bytes encode_segmentation(const FrameMasks& masks) {
  ByteWriter out;
  out.u32(static_cast<std::uint32_t>(masks.width));
  out.u32(static_cast<std::uint32_t>(masks.height));
  for (const Instance& instance : masks.instances) {
    out.u16(instance.object_class);
    out.u16(
        static_cast<std::uint16_t>((instance.moves ? kMoves : 0) | (instance.body ? kHasBody : 0)));
    out.f32(instance.score);
    out.u32(static_cast<std::uint32_t>(instance.runs.size()));
    if (instance.body) {
      for (const BodyPoint& point : *instance.body) {
        out.f32(point.u);
        out.f32(point.v);
        out.u32(static_cast<std::uint32_t>(point.visibility));
      }
    }
    for (const std::uint32_t run : instance.runs) out.u32(run);
  }
  return out.take();
}

}  // namespace slambed::wire
