// SPDX-License-Identifier: Apache-2.0
#include "slam/matching.hpp"

#include <algorithm>
#include <cmath>

#include "features/descriptor_distance.hpp"

namespace slambed {

bool Viewpoint::project(const Eigen::Vector3d& p_w, Projection& out) const {
  const Eigen::Vector3d p_c = T_cw_ * p_w;
  if (!(p_c.z() > 0)) return false;
  const Camera& camera = sensor_.camera;
  const double inverse_z = 1 / p_c.z();
  const double u = camera.fx * p_c.x() * inverse_z + camera.cx;
  const double v = camera.fy * p_c.y() * inverse_z + camera.cy;
  if (!sensor_.bounds.contains(u, v)) return false;
  out.u = static_cast<float>(u);
  out.v = static_cast<float>(v);
  out.right_u = static_cast<float>(u - camera.bf * inverse_z);
  return true;
}

bool Viewpoint::sees(const PointSketch& point, Projection& out) const {
  if (!project(point.p_w, out)) return false;
  const Eigen::Vector3f ray = (point.p_w - center_).cast<float>();
  out.distance_m = ray.norm();
  if (out.distance_m < kNearest * point.min_distance_m ||
      out.distance_m > kFarthest * point.max_distance_m)
    return false;
  out.view_cosine = ray.dot(point.normal) / out.distance_m;
  return out.view_cosine >= kMinViewCosine;
}

void RotationCheck::clear() {
  for (auto& bin : bins_) bin.clear();
}

void RotationCheck::add(float from_deg, float to_deg, int feature) {
  constexpr float kBinWidth = 360.0f / kBins;
  float turn = from_deg - to_deg;
  if (turn < 0) turn += 360.0f;
  const int bin = static_cast<int>(std::lround(turn / kBinWidth)) % kBins;
  bins_[bin].push_back(feature);
}

std::vector<int> RotationCheck::disagreeing() const {
  std::array<int, kBins> order;
  for (int i = 0; i < kBins; ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(),
                   [this](int a, int b) { return bins_[a].size() > bins_[b].size(); });
  constexpr std::size_t kKept = 3;
  constexpr double kLeastShare = 0.1;
  const double least = kLeastShare * static_cast<double>(bins_[order[0]].size());
  std::vector<int> rejected;
  for (std::size_t rank = 0; rank < order.size(); ++rank) {
    const auto& bin = bins_[order[rank]];
    if (rank == 0 || (rank < kKept && static_cast<double>(bin.size()) >= least)) continue;
    rejected.insert(rejected.end(), bin.begin(), bin.end());
  }
  return rejected;
}

Matcher::Best Matcher::closest(const FeatureSet& features, const Descriptor& descriptor) {
  Best best;
  if (window_.empty()) return best;
  distances_.resize(window_.size());
  descriptor_distance().to_some(descriptor, features.descriptors().data(), window_,
                                distances_.data());
  for (std::size_t i = 0; i < window_.size(); ++i) {
    const int octave = features.keypoint(window_[i]).octave;
    if (distances_[i] < best.distance) {
      best.second_distance = best.distance;
      best.second_octave = best.octave;
      best.distance = distances_[i];
      best.octave = octave;
      best.feature = window_[i];
    } else if (distances_[i] < best.second_distance) {
      best.second_distance = distances_[i];
      best.second_octave = octave;
    }
  }
  return best;
}

std::vector<std::pair<int, int>> Matcher::match_all(std::span<const Seen> points,
                                                    const FeatureSet& features, float ratio) {
  struct Holder {
    int point = -1;
    int distance = 257;
  };
  const int n = features.size();
  std::vector<Holder> holder(n);
  distances_.resize(n);
  for (std::size_t p = 0; p < points.size(); ++p) {
    descriptor_distance().to_all(*points[p].descriptor, features.descriptors(), distances_.data());
    int best = -1, best_distance = 257, second_distance = 257;
    for (int i = 0; i < n; ++i) {
      if (distances_[i] < best_distance) {
        second_distance = best_distance;
        best_distance = distances_[i];
        best = i;
      } else if (distances_[i] < second_distance) {
        second_distance = distances_[i];
      }
    }
    if (best < 0 || best_distance > kHammingLow ||
        static_cast<float>(best_distance) >= ratio * static_cast<float>(second_distance))
      continue;
    if (best_distance < holder[best].distance) holder[best] = {static_cast<int>(p), best_distance};
  }
  RotationCheck rotation;
  for (int i = 0; i < n; ++i)
    if (holder[i].point >= 0)
      rotation.add(points[holder[i].point].angle_deg, features.keypoint(i).angle_deg, i);
  for (const int i : rotation.disagreeing()) holder[i].point = -1;
  std::vector<std::pair<int, int>> matches;
  for (int i = 0; i < n; ++i)
    if (holder[i].point >= 0) matches.emplace_back(holder[i].point, i);
  return matches;
}

}  // namespace slambed
