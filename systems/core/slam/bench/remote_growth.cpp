// SPDX-License-Identifier: Apache-2.0
// remote_growth [KEYFRAMES]: maps an earlier trip of so many keyframes through an endless hall and
// measures the cost of matching a second trip with it. Times are medians of the thread's CPU time.
#include <time.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "../bench/endless_scene.hpp"
#include "map/appearance.hpp"
#include "slam/pose_correction.hpp"
#include "slam/remote_mapper.hpp"

namespace slambed::testing {
namespace {

constexpr double kRadius_m = 8, kShift_m = 3, kStep_m = 0.6;
constexpr int kAsked = 30;  ///< keyframes of the second trip
constexpr int kMemory = 8;  ///< keyframes after which an unseen point is forgotten

SE3 stand(double place) {
  const double angle = place * kStep_m / kRadius_m;
  const Eigen::Vector3d eye(kRadius_m * std::cos(angle) + kShift_m * angle / (2 * M_PI),
                            0.05 * std::sin(3 * angle), kRadius_m * std::sin(angle));
  return SE3(Eigen::AngleAxisd(-angle, Eigen::Vector3d::UnitY()).toRotationMatrix(), eye).inverse();
}

double cpu_ms() {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

/// Makes keyframes of one trip; a feature within 10 cm of a known point observes that point.
class Trip {
 public:
  Trip(EndlessScene& scene, IdSpace space) : scene_(scene), keyframes_(space), points_(space) {}

  MapDelta next(double place, const SE3& T_cw) {
    MapDelta delta;
    NewKeyFrame keyframe;
    keyframe.id = keyframes_.next();
    keyframe.timestamp_s = ++made_;
    keyframe.features = scene_.look(stand(place));
    keyframe.T_cw = T_cw;
    const FeatureSet& features = *keyframe.features;
    std::erase_if(known_, [&](const Tracked& k) { return k.seen < made_ - kMemory; });
    std::vector<std::uint8_t> taken(known_.size());
    for (int i = 0; i < features.size(); ++i) {
      const KeyPoint& seen = features.keypoint(i);
      const Eigen::Vector3d p_w =
          T_cw.inverse() * features.sensor().camera.unproject(seen.u, seen.v, seen.depth_m);
      std::size_t found = known_.size();
      for (std::size_t k = 0; k < known_.size() && found == known_.size(); ++k)
        if (!taken[k] && (known_[k].p_w - p_w).squaredNorm() < 0.01) found = k;
      if (found < taken.size()) taken[found] = 1;
      if (found == known_.size()) {
        NewPoint point{.id = points_.next(),
                       .p_w = p_w,
                       .appearance = {},
                       .reference = {},
                       .first_keyframe = {}};
        point.appearance = appearance_of(p_w, T_cw, features, i);
        point.reference = point.first_keyframe = keyframe.id;
        known_.push_back({point, p_w, made_});
        taken.push_back(1);
      }
      known_[found].seen = made_;
      keyframe.points.push_back(known_[found].point.id);
      delta.points.push_back(known_[found].point);  // not only new points: all that it sees
    }
    delta.keyframes.push_back(std::move(keyframe));
    return delta;
  }

 private:
  struct Tracked {
    NewPoint point;
    Eigen::Vector3d p_w;
    int seen;
  };
  EndlessScene& scene_;
  IdSource<KeyFrameId> keyframes_;
  IdSource<MapPointId> points_;
  std::vector<Tracked> known_;
  int made_ = 0;
};

void run(int wanted) {
  EndlessScene scene;
  const auto map = std::make_shared<Map>();
  const auto places = std::make_shared<PlaceIndex>(scene.vocabulary());
  Trip first(scene, IdSpace::kEdgeMapper), second(scene, IdSpace::kTracker);
  for (int k = 0; k < wanted; ++k) map->commit(first.next(k, stand(k)));
  places->update_from(*map);
  RemoteMapper mapper({}, map, places);
  std::vector<double> match_ms, bundle_ms, per_try_ms, features, observations, correct_ms, moved;
  int matched = 0;
  const Eigen::Matrix<double, 6, 1> drift =
      (Eigen::Matrix<double, 6, 1>() << 0.3, 0.05, 0.4, 0, 0.01, 0).finished();
  Map local;
  for (int k = 0; k < kAsked; ++k) {
    const double place = 5 + 0.8 * k + 0.5;
    const SE3 believed = stand(place) * SE3::exp(drift);
    const MapDelta received = second.next(place, believed);
    local.commit(received);
    double begin = cpu_ms();
    const RemoteMapper::Match match = mapper.match(received, true);
    map->commit(match.delta);
    match_ms.push_back(cpu_ms() - begin);
    per_try_ms.push_back(match_ms.back() / std::max(1, match.tried));
    features.push_back(received.keyframes.front().features->size());
    if (!match.matched) continue;
    ++matched;
    const KeyFrameId id = received.keyframes.front().id;
    begin = cpu_ms();
    if (mapper.begin_bundle(id)) {
      observations.push_back(static_cast<double>(mapper.bundle_observations()));
      while (mapper.step_bundle()) {
      }
      map->commit(mapper.finish_bundle());
    }
    bundle_ms.push_back(cpu_ms() - begin);
    begin = cpu_ms();
    const auto correction = local.read([&](const MapView& view) {
      return correct_pose(view, id, stand(place), {.window_s = 25, .graded = true});
    });
    local.commit(correction->delta);
    moved.push_back(static_cast<double>(correction->delta.positions.size()));
    correct_ms.push_back(cpu_ms() - begin);
  }
  std::printf("%d,%d,%d,%.0f,%.2f,%.2f,%.0f,%.2f,%.2f,%.0f\n", wanted, kAsked, matched,
              median(features), median(match_ms), median(per_try_ms), median(observations),
              median(bundle_ms), median(correct_ms), median(moved));
}

}  // namespace
}  // namespace slambed::testing

int main(int argc, char** argv) {
  const long keyframes = argc > 1 ? std::strtol(argv[1], nullptr, 10) : 2000;
  if (keyframes < 50) {
    std::fprintf(stderr, "error: remote_growth %s: give a number of keyframes, 50 or more\n",
                 argv[1]);
    return 2;
  }
  std::printf(
      "prior,asked,matched,features,match_ms,per_candidate_ms,observations,bundle_ms,correct_ms,"
      "points_moved\n");
  slambed::testing::run(static_cast<int>(keyframes));
  return 0;
}
