// SPDX-License-Identifier: Apache-2.0
// The stages of tracking and mapping on a synthetic walk of a hundred frames.
#include <benchmark/benchmark.h>

#include "../tests/synthetic_world.hpp"
#include "slam/frame_search.hpp"
#include "slam/local_mapper.hpp"
#include "slam/tracker.hpp"

namespace slambed::testing {
namespace {

constexpr int kFrames = 100;
constexpr Seeing kCamera{.pixel_noise = 0.5, .depth_noise = 0.01, .flipped_bits = 15};

/// A walk that was tracked and mapped, with a keyframe every eighth frame.
struct Walked {
  Walked() {
    for (int i = 0; i < kFrames; ++i) frames.push_back(world.look(walk(i), kCamera));
    for (int i = 0; i < kFrames; ++i) {
      if (tracker.track(i, i, frames[i]).initialised_now || i % 8 == 7) {
        newest = tracker.create_keyframe().keyframes[0].id;
        mapper.insert(newest);
        map->commit(mapper.triangulate());
        map->commit(mapper.fuse());
      }
    }
    mapper.insert(newest);
  }
  SyntheticWorld world{8000};
  std::vector<std::shared_ptr<const FeatureSet>> frames;
  std::shared_ptr<Map> map = std::make_shared<Map>();
  Tracker tracker{{}, map, IdSpace::kTracker};
  LocalMapper mapper{{}, map, IdSpace::kEdgeMapper};
  KeyFrameId newest;
};

Walked& walked() {
  static Walked once;
  return once;
}

void TrackFrame(benchmark::State& state) {
  Walked& w = walked();
  // Back and forth along the end of the walk, so that the motion stays continuous.
  int i = kFrames - 1, step = -1;
  for (auto _ : state) {
    benchmark::DoNotOptimize(w.tracker.track(i, i, w.frames[i]));
    if (i + step < kFrames / 2 || i + step >= kFrames) step = -step;
    i += step;
  }
}
BENCHMARK(TrackFrame)->Unit(benchmark::kMicrosecond);

void MatchKeyFrameByDescriptor(benchmark::State& state) {
  Walked& w = walked();
  std::vector<SeenPoint> points;
  copy_seen_points(*w.map, w.newest, points);
  Frame frame;
  frame.begin(0, 0, w.frames.back());
  FrameSearch search;
  for (auto _ : state) benchmark::DoNotOptimize(search.match_by_descriptor(points, 0.7f, frame));
}
BENCHMARK(MatchKeyFrameByDescriptor)->Unit(benchmark::kMicrosecond);

void Triangulate(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(walked().mapper.triangulate());
}
BENCHMARK(Triangulate)->Unit(benchmark::kMicrosecond);

void Fuse(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(walked().mapper.fuse());
}
BENCHMARK(Fuse)->Unit(benchmark::kMicrosecond);

void Bundle(benchmark::State& state) {
  LocalMapper& mapper = walked().mapper;
  for (auto _ : state) {
    mapper.begin_bundle();
    while (mapper.step_bundle()) {
    }
    benchmark::DoNotOptimize(mapper.finish_bundle());
  }
}
BENCHMARK(Bundle)->Unit(benchmark::kMicrosecond);

void CullKeyFrames(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(walked().mapper.cull_keyframes());
}
BENCHMARK(CullKeyFrames)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace slambed::testing
