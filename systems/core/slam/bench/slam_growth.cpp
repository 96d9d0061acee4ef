// SPDX-License-Identifier: Apache-2.0
// slam_growth [KEYFRAMES]: tracks and maps a camera that walks in circles through an endless hall,
// each circle 3 m further on. Prints as CSV the cost of a frame and of a keyframe against the size
// of the map. Times are medians of the thread's CPU time since the row before. yardstick_ms times
// constant work, tracking in a small map that does not grow: it changes only with the host.
#include <malloc.h>
#include <time.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "../bench/endless_scene.hpp"
#include "slam/local_mapper.hpp"
#include "slam/loop_closer.hpp"
#include "slam/tracker.hpp"

namespace slambed::testing {
namespace {

constexpr int kRowEvery = 50;  ///< keyframes
constexpr double kRadius_m = 8, kShift_m = 3, kStep_m = 0.2;
constexpr int kMaxFrames = 400'000;

SE3 stand(int frame) {
  const double angle = frame * kStep_m / kRadius_m;
  const double turns = angle / (2 * M_PI);
  const Eigen::Vector3d eye(kRadius_m * std::cos(angle) + kShift_m * turns,
                            0.05 * std::sin(3 * angle), kRadius_m * std::sin(angle));
  // The camera's z axis is the tangent of the circle.
  const Eigen::Matrix3d R_wc =
      Eigen::AngleAxisd(-angle, Eigen::Vector3d::UnitY()).toRotationMatrix();
  return SE3(R_wc, eye).inverse();
}

double cpu_ms() {
  timespec now{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

double heap_mb() { return 1e-6 * static_cast<double>(::mallinfo2().uordblks); }

class Times {
 public:
  template <typename Work>
  auto measure(Work&& work) {
    const double begin = cpu_ms();
    auto result = work();
    add(cpu_ms() - begin);
    return result;
  }
  void add(double ms) { ms_.push_back(ms); }
  double take_median() {
    if (ms_.empty()) return 0;
    std::nth_element(ms_.begin(), ms_.begin() + ms_.size() / 2, ms_.end());
    const double median = ms_[ms_.size() / 2];
    ms_.clear();
    return median;
  }

 private:
  std::vector<double> ms_;
};

/// Tracks the same frames back and forth in the map of the first few meters.
class Yardstick {
 public:
  Yardstick() {
    for (int frame = 0; frame < kFrames; ++frame) {
      frames_.push_back(scene_.look(stand(frame)));
      tracker_.track(frame, frame / 30.0, frames_.back());
      if (frame % 5 == 0) tracker_.create_keyframe();
    }
  }
  double median_ms() {
    Times times;
    for (int i = 2 * kFrames - 2; i > 0; --i) {
      const int frame = i < kFrames ? kFrames - 1 - i : i - kFrames + 1;
      times.measure([&] { return tracker_.track(frame, frame / 30.0, frames_[frame]); });
    }
    return times.take_median();
  }

 private:
  static constexpr int kFrames = 40;
  EndlessScene scene_;
  std::vector<std::shared_ptr<const FeatureSet>> frames_;
  Tracker tracker_{{.min_init_features = 200}, std::make_shared<Map>(), IdSpace::kTracker};
};

class Growth {
 public:
  void run(std::size_t wanted) {
    std::printf(
        "keyframes,points,frames,losses,loops,track_ms,map_ms,bundle_ms,detect_ms,verify_ms,heap_"
        "mb,yardstick_ms\n");
    std::size_t next_row = kRowEvery;
    for (int frame = 0; frame < kMaxFrames; ++frame) {
      const auto features = scene_.look(stand(frame));
      const TrackOutcome outcome =
          track_.measure([&] { return tracker_.track(frame, frame / 30.0, features); });
      losses_ += outcome.state == TrackingState::kLost;
      if (!tracker_.wants_keyframe({})) continue;
      for (const NewKeyFrame& made : tracker_.create_keyframe().keyframes) map_keyframe(made.id);
      const auto [keyframes, points] = map_->read(
          [](const MapView& view) { return std::pair(view.keyframe_count(), view.point_count()); });
      if (keyframes < next_row) continue;
      next_row = keyframes + kRowEvery;
      std::printf("%zu,%zu,%d,%d,%d,%.3f,%.2f,%.2f,%.3f,%.3f,%.1f,%.3f\n", keyframes, points, frame,
                  losses_, loops_, track_.take_median(), mapping_.take_median(),
                  bundle_.take_median(), detect_.take_median(), verify_.take_median(),
                  heap_mb() - heap_before_mb_, yardstick_.median_ms());
      std::fflush(stdout);
      if (keyframes >= wanted) return;
    }
  }

 private:
  void map_keyframe(KeyFrameId id) {
    mapping_.measure([&] {
      mapper_.insert(id);
      map_->commit(mapper_.cull_points());
      map_->commit(mapper_.triangulate());
      map_->commit(mapper_.fuse());
      bundle_.measure([&] {
        if (mapper_.begin_bundle())
          while (mapper_.step_bundle()) {
          }
        return map_->commit(mapper_.finish_bundle()).applied;
      });
      return map_->commit(mapper_.cull_keyframes()).applied;
    });
    if (!detect_.measure([&] { return closer_.detect(id); })) return;
    if (!verify_.measure([&] { return closer_.verify(); })) return;
    ++loops_;
    map_->commit(closer_.correct());
    if (!closer_.begin_graph()) return;
    while (closer_.step_graph()) {
    }
    map_->commit(closer_.finish_graph());
  }

  Yardstick yardstick_;
  EndlessScene scene_;
  std::shared_ptr<Map> map_ = std::make_shared<Map>();
  std::shared_ptr<PlaceIndex> places_ = std::make_shared<PlaceIndex>(scene_.vocabulary());
  Tracker tracker_{{.min_init_features = 200}, map_, IdSpace::kTracker, places_};
  LocalMapper mapper_{{}, map_, IdSpace::kMobileMapper};
  LoopCloser closer_{{}, map_, places_};
  Times track_, mapping_, bundle_, detect_, verify_;
  double heap_before_mb_ = heap_mb();
  int losses_ = 0, loops_ = 0;
};

}  // namespace
}  // namespace slambed::testing

int main(int argc, char** argv) {
  const long keyframes = argc > 1 ? std::strtol(argv[1], nullptr, 10) : 2000;
  if (keyframes < 1) {
    std::fprintf(stderr, "error: slam_growth %s: give a number of keyframes\n", argv[1]);
    return 2;
  }
  slambed::testing::Growth().run(static_cast<std::size_t>(keyframes));
  return 0;
}
