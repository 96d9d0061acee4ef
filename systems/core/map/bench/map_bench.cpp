// SPDX-License-Identifier: Apache-2.0
// Times a commit (a new keyframe, the result of a bundle adjustment) and a copy of the whole map,
// which holds the shared lock, by map size.
#include <benchmark/benchmark.h>

#include "../tests/map_fixture.hpp"
#include "map/map_snapshot.hpp"

namespace slambed::testing {
namespace {

constexpr int kFeatures = 1000, kMatched = 400, kFresh = 100;

/// Keyframe n sees the last kMatched points known before it and kFresh new ones.
MapDelta keyframe_delta(int n) {
  MapDelta delta;
  const int first_new = (n - 1) * kFresh + 1;
  std::vector<std::uint64_t> numbers(kFeatures);
  for (int i = 0; i < kMatched; ++i) numbers[i] = std::max(0, first_new - kMatched + i);
  for (int i = 0; i < kFresh; ++i) {
    numbers[kMatched + i] = first_new + i;
    delta.points.push_back(new_point(first_new + i));
  }
  delta.keyframes.push_back(new_keyframe(n, numbers));
  return delta;
}

void CommitKeyFrame(benchmark::State& state) {
  const int size = static_cast<int>(state.range(0));
  Map map;
  for (int n = 1; n <= size; ++n) map.commit(keyframe_delta(n));
  int next = size;
  for (auto _ : state) {
    state.PauseTiming();
    const MapDelta delta = keyframe_delta(++next);
    state.ResumeTiming();
    benchmark::DoNotOptimize(map.commit(delta));
  }
}
BENCHMARK(CommitKeyFrame)
    ->Arg(10)
    ->Arg(100)
    ->Arg(500)
    ->Iterations(100)
    ->Unit(benchmark::kMillisecond);

void CommitMovedPoints(benchmark::State& state) {
  Map map;
  for (int n = 1; n <= 60; ++n) map.commit(keyframe_delta(n));
  std::uint32_t version = 0;
  for (auto _ : state) {
    state.PauseTiming();
    MapDelta delta;
    ++version;
    for (int n = 1; n <= state.range(0); ++n)
      delta.positions.push_back({pt(n), {0.001 * version, 0, 2}, version});
    state.ResumeTiming();
    benchmark::DoNotOptimize(map.commit(delta));
  }
}
BENCHMARK(CommitMovedPoints)->Arg(2000)->Unit(benchmark::kMillisecond);

void CopyMap(benchmark::State& state) {
  const int size = static_cast<int>(state.range(0));
  Map map;
  for (int n = 1; n <= size; ++n) map.commit(keyframe_delta(n));
  for (auto _ : state) benchmark::DoNotOptimize(map.read(snapshot));
}
BENCHMARK(CopyMap)->Arg(50)->Arg(200)->Arg(500)->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace slambed::testing
