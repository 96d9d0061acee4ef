// SPDX-License-Identifier: Apache-2.0
#include "features/feature_set.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "base/error.hpp"

namespace slambed {
namespace {

constexpr int kColumns = 64, kRows = 48;  // ORB-SLAM2's grid
/// cell_begin_ and cell_items_ hold 16-bit numbers.
constexpr std::size_t kMostFeatures = std::numeric_limits<std::uint16_t>::max();

/// Maps a coordinate to its cell along one axis, or to the nearest cell when it is outside.
struct GridAxis {
  GridAxis(double low, double high, int cells)
      : low_(static_cast<float>(low)),
        per_px_(static_cast<float>(cells / (high - low))),
        last_(static_cast<float>(cells - 1)) {}
  int cell(float value) const {
    const float position = (value - low_) * per_px_;
    return static_cast<int>(std::min(std::max(position, 0.0f), last_));
  }
  float low_, per_px_, last_;
};

GridAxis x_axis(const ImageBounds& b) { return {b.min_x, b.max_x, kColumns}; }
GridAxis y_axis(const ImageBounds& b) { return {b.min_y, b.max_y, kRows}; }

}  // namespace

FeatureSet::FeatureSet(std::shared_ptr<const Sensor> sensor, std::vector<KeyPoint> keypoints,
                       std::vector<Descriptor> descriptors)
    : sensor_(std::move(sensor)),
      keypoints_(std::move(keypoints)),
      descriptors_(std::move(descriptors)) {
  if (!sensor_) throw bad_input("feature set: no sensor given");
  const ImageBounds& bounds = sensor_->bounds;
  if (!(bounds.max_x > bounds.min_x && bounds.max_y > bounds.min_y))
    throw bad_input("feature set: the image bounds of the sensor are empty, set width and height");
  if (keypoints_.size() != descriptors_.size())
    throw bad_input("feature set: " + std::to_string(keypoints_.size()) + " keypoints but " +
                    std::to_string(descriptors_.size()) + " descriptors");
  if (keypoints_.size() > kMostFeatures)
    throw bad_input("feature set: more than " + std::to_string(kMostFeatures) + " keypoints");

  const GridAxis columns = x_axis(bounds), rows = y_axis(bounds);
  std::vector<std::uint16_t> cell_of(keypoints_.size());
  cell_begin_.assign(kColumns * kRows + 1, 0);
  for (std::size_t i = 0; i < keypoints_.size(); ++i) {
    const KeyPoint& p = keypoints_[i];
    if (!std::isfinite(p.u) || !std::isfinite(p.v))
      throw bad_input("feature set: keypoint " + std::to_string(i) + " has no finite position");
    if (p.octave >= sensor_->pyramid.levels())
      throw bad_input("feature set: keypoint " + std::to_string(i) + " is on octave " +
                      std::to_string(p.octave) + ", the sensor has " +
                      std::to_string(sensor_->pyramid.levels()));
    cell_of[i] = static_cast<std::uint16_t>(rows.cell(p.v) * kColumns + columns.cell(p.u));
    ++cell_begin_[cell_of[i] + 1];
  }
  for (std::size_t c = 1; c < cell_begin_.size(); ++c)
    cell_begin_[c] = static_cast<std::uint16_t>(cell_begin_[c] + cell_begin_[c - 1]);
  cell_items_.resize(keypoints_.size());
  std::vector<std::uint16_t> next(cell_begin_.begin(), cell_begin_.end() - 1);
  for (std::size_t i = 0; i < keypoints_.size(); ++i)
    cell_items_[next[cell_of[i]]++] = static_cast<std::uint16_t>(i);
}

void FeatureSet::in_window(float u, float v, float radius_px, int min_octave, int max_octave,
                           std::vector<int>& out) const {
  out.clear();
  if (!(radius_px > 0) || !std::isfinite(u) || !std::isfinite(v)) return;
  const GridAxis columns = x_axis(sensor_->bounds), rows = y_axis(sensor_->bounds);
  const int first_column = columns.cell(u - radius_px), last_column = columns.cell(u + radius_px);
  const int first_row = rows.cell(v - radius_px), last_row = rows.cell(v + radius_px);
  for (int row = first_row; row <= last_row; ++row) {
    // The cells of one row are contiguous in cell_items_.
    const int begin = cell_begin_[row * kColumns + first_column];
    const int end = cell_begin_[row * kColumns + last_column + 1];
    for (int k = begin; k < end; ++k) {
      const int i = cell_items_[k];
      const KeyPoint& p = keypoints_[i];
      if (p.octave >= min_octave && p.octave <= max_octave && std::abs(p.u - u) < radius_px &&
          std::abs(p.v - v) < radius_px)
        out.push_back(i);
    }
  }
}

std::shared_ptr<const FeatureSet> select(const FeatureSet& features,
                                         std::span<const std::uint8_t> keep) {
  if (keep.size() != features.keypoints().size())
    throw bad_input("select features: " + std::to_string(keep.size()) + " choices for " +
                    std::to_string(features.size()) + " features");
  std::vector<KeyPoint> keypoints;
  std::vector<Descriptor> descriptors;
  for (int i = 0; i < features.size(); ++i) {
    if (!keep[i]) continue;
    keypoints.push_back(features.keypoint(i));
    descriptors.push_back(features.descriptor(i));
  }
  return std::make_shared<const FeatureSet>(features.sensor_ptr(), std::move(keypoints),
                                            std::move(descriptors));
}

}  // namespace slambed
