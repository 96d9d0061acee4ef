// SPDX-License-Identifier: Apache-2.0
#include "slam/relocalizer.hpp"

#include <algorithm>

#include "features/default_vocabulary.hpp"
#include "geometry/pnp_ransac.hpp"
#include "slam/word_matching.hpp"

namespace slambed {
namespace {

// ORB-SLAM2's limits of a relocalization.
constexpr float kRatio = 0.75f;
constexpr std::size_t kLeastMatches = 15;
constexpr int kLeastInliers = 10;
constexpr int kInliersWanted = 50;
constexpr int kWorthASecondLook = 30;
constexpr float kWideWindow_px = 10, kNarrowWindow_px = 3;
constexpr int kNarrowDistance = 64;  ///< bits

}  // namespace

std::vector<KeyFrameId> Relocalizer::candidates(const Map& map, KeyFrameId around,
                                                const BagOfWords& bag) const {
  std::vector<KeyFrameId> list = places_->candidates(bag, map);
  // Most often the camera is still where it was lost.
  if (map.read([&](const MapView& view) { return view.keyframe(around) != nullptr; })) {
    std::erase(list, around);
    list.insert(list.begin(), around);
  }
  if (list.size() > kCandidates) list.resize(kCandidates);
  return list;
}

bool Relocalizer::copy(const Map& map, KeyFrameId candidate) {
  points_.clear();
  return map.read([&](const MapView& view) {
    const KeyFrame* keyframe = view.keyframe(candidate);
    if (!keyframe) return false;
    features_ = keyframe->features;
    point_of_feature_.assign(keyframe->points.size(), -1);
    has_point_.assign(keyframe->points.size(), 0);
    for (std::size_t i = 0; i < keyframe->points.size(); ++i) {
      const MapPoint* point = keyframe->points[i] ? view.point(keyframe->points[i]) : nullptr;
      if (!point) continue;
      const KeyPoint& seen = keyframe->features->keypoint(static_cast<int>(i));
      point_of_feature_[i] = static_cast<int>(points_.size());
      has_point_[i] = 1;
      points_.push_back({point->id, point->p_w, point->appearance.descriptor, seen.angle_deg,
                         seen.octave, point->appearance.min_distance_m,
                         point->appearance.max_distance_m});
    }
    return points_.size() >= kLeastMatches;
  });
}

/// Sets the pose and matches of the largest inlier set.
bool Relocalizer::start_pose(std::span<const std::pair<int, int>> matches, Frame& frame) const {
  const FeatureSet& features = *frame.features;
  std::vector<PnpCorrespondence> pairs;
  pairs.reserve(matches.size());
  for (const auto& [theirs, ours] : matches) {
    const KeyPoint& seen = features.keypoint(ours);
    pairs.push_back({points_[point_of_feature_[theirs]].p_w, seen.u, seen.v,
                     1 / static_cast<double>(features.inv_sigma2(ours))});
  }
  const auto found =
      solve_pnp_ransac(features.sensor().camera, pairs, {.min_inliers = kLeastInliers});
  if (!found) return false;
  frame.clear_matches();
  frame.T_cw = found->T_cw;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (!found->inlier[i]) continue;
    const SeenPoint& point = points_[point_of_feature_[matches[i].first]];
    frame.match(matches[i].second, point.id, point.p_w);
  }
  return true;
}

bool Relocalizer::try_keyframe(const BagOfWords& bag, const BagOfWords& candidate_bag,
                               FrameSearch& search, Frame& frame) {
  const auto matches =
      match_by_words({*features_, candidate_bag, has_point_}, {*frame.features, bag, {}}, kRatio);
  if (matches.size() < kLeastMatches || !start_pose(matches, frame)) return false;
  ++candidates_posed_;
  int inliers = search.optimize_pose(frame);
  if (inliers < kLeastInliers) return false;
  if (inliers >= kInliersWanted) return true;
  frame.drop_outliers();
  if (inliers + search.add_projected(points_, kWideWindow_px, kHammingHigh, frame) < kInliersWanted)
    return false;
  inliers = search.optimize_pose(frame);
  if (inliers <= kWorthASecondLook) return false;
  if (inliers >= kInliersWanted) return true;
  frame.drop_outliers();
  if (inliers + search.add_projected(points_, kNarrowWindow_px, kNarrowDistance, frame) <
      kInliersWanted)
    return false;
  return search.optimize_pose(frame) >= kInliersWanted;
}

PlaceIndex& Relocalizer::places() {
  if (!places_) places_ = std::make_shared<PlaceIndex>(default_vocabulary());
  return *places_;
}

int Relocalizer::match(const Map& map, KeyFrameId keyframe, float ratio, Frame& frame) {
  frame.clear_matches();
  if (!copy(map, keyframe)) return 0;
  const Vocabulary& vocabulary = places().vocabulary();
  auto theirs = places().bag(keyframe);
  if (!theirs)
    theirs = std::make_shared<BagOfWords>(vocabulary.transform(features_->descriptors()));
  const BagOfWords ours = vocabulary.transform(frame.features->descriptors());
  const auto matches =
      match_by_words({*features_, *theirs, has_point_}, {*frame.features, ours, {}}, ratio);
  for (const auto& [their, our] : matches) {
    const SeenPoint& point = points_[point_of_feature_[their]];
    frame.match(our, point.id, point.p_w);
  }
  return static_cast<int>(matches.size());
}

bool Relocalizer::locate(const Map& map, KeyFrameId around, FrameSearch& search, Frame& frame) {
  candidates_posed_ = 0;
  places().update_from(map);
  const BagOfWords bag = places_->vocabulary().transform(frame.features->descriptors());
  for (const KeyFrameId candidate : candidates(map, around, bag)) {
    const auto candidate_bag = places_->bag(candidate);
    if (!candidate_bag || !copy(map, candidate)) continue;
    if (!try_keyframe(bag, *candidate_bag, search, frame)) continue;
    frame.drop_outliers();
    return true;
  }
  frame.clear_matches();
  return false;
}

}  // namespace slambed
