// SPDX-License-Identifier: Apache-2.0
#include "wire/text_features.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "wire/feature_codec.hpp"

namespace slambed::wire {
namespace {

constexpr int kColumns = 64, kRows = 48;  ///< ORB-SLAM2's search grid
constexpr int kDescriptorBytes = 32, kBitsOfByte = 8, kBytesOfWord = 8;
constexpr int kMaxByte = 255;
constexpr float kPatchPx = 31;  ///< ORB-SLAM2's PATCH_SIZE, a key point's size at level 0
constexpr float kNoResponse = 0;
constexpr int kNoClass = -1;
constexpr float kMarginPx = 32;  ///< undistortion may move a key point out of the bounds
constexpr float kMaxDepth = 4096;
constexpr std::size_t kFeatureChars = 2 * 7 * 2 + 2 * 2 + 2 * kDescriptorBytes;

void put_keypoint(TextWriter& out, const FeatureSet& features, const KeyPoint& point) {
  out.real(point.u);
  out.real(point.v);
  out.real(kPatchPx * features.sensor().pyramid.scale[point.octave]);
  out.real(point.angle_deg);
  out.real(kNoResponse);
  out.integer(point.octave);
  out.integer(kNoClass);
}

KeyPoint get_keypoint(TextReader& in, const Sensor& sensor) {
  KeyPoint point;
  point.u = in.real32();
  point.v = in.real32();
  const ImageBounds& bounds = sensor.bounds;
  if (point.u < bounds.min_x - kMarginPx || point.u > bounds.max_x + kMarginPx ||
      point.v < bounds.min_y - kMarginPx || point.v > bounds.max_y + kMarginPx) {
    throw DecodeError("key point lies outside the image");
  }
  in.real32();
  point.angle_deg = in.real32();
  if (point.angle_deg < 0 || point.angle_deg > 360) throw DecodeError("angle is out of range");
  in.real32();
  point.octave = static_cast<std::uint8_t>(in.integer(0, sensor.pyramid.levels() - 1));
  in.integer(kNoClass, kNoClass);
  return point;
}

void put_words(TextWriter& out, const BagOfWords& bag) {
  out.integer(bag.words.size());
  for (const auto& [word, weight] : bag.words) {
    out.integer(word);
    out.real(static_cast<double>(weight));
  }
  out.integer(bag.nodes.size());
  for (const auto& [node, items] : bag.nodes) {
    out.integer(node);
    out.integer(items.size());
    for (const std::uint16_t item : items) out.integer(item);
  }
}

void skip_words(TextReader& in) {
  constexpr std::int64_t kAny = UINT32_MAX;
  for (std::size_t n = in.count(4); n > 0; --n) {
    in.integer(0, kAny);
    in.real64();
  }
  for (std::size_t n = in.count(4); n > 0; --n) {
    in.integer(0, kAny);
    for (std::size_t items = in.count(2); items > 0; --items) in.integer(0, UINT16_MAX);
  }
}

void put_grid(TextWriter& out, const FeatureSet& features) {
  const ImageBounds& bounds = features.sensor().bounds;
  const double per_column = kColumns / (bounds.max_x - bounds.min_x);
  const double per_row = kRows / (bounds.max_y - bounds.min_y);
  std::array<std::vector<int>, kColumns * kRows> cells;
  for (int i = 0; i < features.size(); ++i) {
    const KeyPoint& point = features.keypoint(i);
    const int column = static_cast<int>(std::lround((point.u - bounds.min_x) * per_column));
    const int row = static_cast<int>(std::lround((point.v - bounds.min_y) * per_row));
    if (column < 0 || column >= kColumns || row < 0 || row >= kRows) continue;
    cells[column * kRows + row].push_back(i);
  }
  out.real(per_column);
  out.real(per_row);
  for (const auto& cell : cells) {
    out.integer(cell.size());
    for (const int item : cell) out.integer(item);
  }
}

void skip_grid(TextReader& in) {
  in.real64();
  in.real64();
  for (int cell = 0; cell < kColumns * kRows; ++cell) {
    for (std::size_t items = in.count(2); items > 0; --items) in.integer(0, UINT16_MAX);
  }
}

void put_scales(TextWriter& out, const ScalePyramid& pyramid) {
  out.integer(pyramid.levels());
  out.real(pyramid.log_scale_factor);
  for (const auto* table : {&pyramid.scale, &pyramid.sigma2, &pyramid.inv_sigma2}) {
    for (const float value : *table) out.real(value);
  }
}

void skip_scales(TextReader& in, const ScalePyramid& pyramid) {
  in.integer(pyramid.levels(), pyramid.levels());
  for (int i = 0; i < 1 + 3 * pyramid.levels(); ++i) in.real32();
}

void write_features(TextWriter& out, const FeatureSet& features, const Vocabulary& vocabulary) {
  put_scales(out, features.sensor().pyramid);
  out.integer(features.size());
  for (const char* which : {"raw", "undistorted"}) {
    out.word(which);
    for (const KeyPoint& point : features.keypoints()) put_keypoint(out, features, point);
  }
  for (const KeyPoint& point : features.keypoints()) out.real(point.right_u);
  for (const KeyPoint& point : features.keypoints()) out.real(point.depth_m);
  for (const Descriptor& descriptor : features.descriptors()) put_descriptor(out, descriptor);
  put_words(out, vocabulary.transform(features.descriptors()));
  put_grid(out, features);
}

std::shared_ptr<const FeatureSet> read_features(TextReader& in,
                                                std::shared_ptr<const Sensor> sensor) {
  skip_scales(in, sensor->pyramid);
  const std::size_t count = in.count(kFeatureChars);
  if (count > kMaxFeatures) throw DecodeError("too many features");
  std::vector<KeyPoint> keypoints(count);
  for (const char* which : {"raw", "undistorted"}) {
    in.expect_word(which);
    for (KeyPoint& point : keypoints) point = get_keypoint(in, *sensor);
  }
  for (KeyPoint& point : keypoints) point.right_u = in.real32();
  for (KeyPoint& point : keypoints) {
    point.depth_m = in.real32();
    if (point.depth_m >= kMaxDepth) throw DecodeError("depth is out of range");
  }
  std::vector<Descriptor> descriptors(count);
  for (Descriptor& descriptor : descriptors) descriptor = get_descriptor(in);
  skip_words(in);
  skip_grid(in);
  return std::make_shared<const FeatureSet>(std::move(sensor), std::move(keypoints),
                                            std::move(descriptors));
}

}  // namespace

void put_descriptor(TextWriter& out, const Descriptor& descriptor) {
  for (const std::uint64_t word : descriptor) {
    for (int i = 0; i < kBytesOfWord; ++i) out.integer(word >> (kBitsOfByte * i) & kMaxByte);
  }
}

Descriptor get_descriptor(TextReader& in) {
  Descriptor descriptor{};
  for (std::uint64_t& word : descriptor) {
    for (int i = 0; i < kBytesOfWord; ++i) {
      word |= static_cast<std::uint64_t>(in.integer(0, kMaxByte)) << (kBitsOfByte * i);
    }
  }
  return descriptor;
}

void put_features(TextWriter& out, const std::shared_ptr<const FeatureSet>& features,
                  const Vocabulary& vocabulary, DirectText* direct) {
  if (!direct) return write_features(out, *features, vocabulary);
  out.add(direct->text_of(features, [&] {
    TextWriter own(TextMeans::kDirect);
    write_features(own, *features, vocabulary);
    return own.take();
  }));
}

std::shared_ptr<const FeatureSet> get_features(TextReader& in,
                                               const std::shared_ptr<const Sensor>& sensor,
                                               DirectText* direct) {
  if (!direct) return read_features(in, sensor);
  in.skip_blanks();
  const std::string_view archive = in.rest();
  if (const auto known = direct->read_before(archive, sensor)) {
    in.skip(known->length);
    return known->features;
  }
  auto features = read_features(in, sensor);
  in.skip_blanks();
  direct->keep_read(features, std::string(archive.substr(0, archive.size() - in.rest().size())));
  return features;
}

}  // namespace slambed::wire
