// SPDX-License-Identifier: Apache-2.0
#include <benchmark/benchmark.h>

#include "optimize/tests/scene.hpp"

namespace slambed {
namespace {

/// Arguments: observations, whether to run all iterations.
void BM_Pose(benchmark::State& state) {
  const auto s =
      scene::make_pose_scene(int(state.range(0)), {.outlier_share = 0.1, .mono_share = 0.2});
  PoseOptimizer optimizer(state.range(1) ? PoseOptions{.relative_stop = 0} : PoseOptions{});
  std::vector<std::uint8_t> outlier;
  PoseResult result;
  for (auto _ : state) {
    result = optimizer.solve(scene::camera(), s.start, s.observations, outlier);
    benchmark::DoNotOptimize(result);
  }
  state.counters["inliers"] = result.inliers;
}
BENCHMARK(BM_Pose)->ArgsProduct({{100, 300, 500, 1000}, {0, 1}})->Unit(benchmark::kMillisecond);

/// Arguments: free and fixed keyframes, points, observations per point, whether to run all
/// iterations.
void BM_Bundle(benchmark::State& state) {
  const auto s =
      scene::make_bundle_scene(int(state.range(0)), int(state.range(1)), int(state.range(2)),
                               int(state.range(3)), {.outlier_share = 0.05});
  BundleOptions options;
  if (state.range(4)) options.relative_stop = 0;
  int steps = 0;
  double cost = 0;
  for (auto _ : state) {
    BundleAdjuster adjuster(s.problem, options);
    steps = 0;
    while (adjuster.step()) ++steps;
    benchmark::DoNotOptimize(adjuster.outliers());
    state.PauseTiming();
    cost = adjuster.robust_cost();
    state.ResumeTiming();
  }
  state.counters["iterations"] = steps;
  state.counters["robust_cost"] = cost;
}
BENCHMARK(BM_Bundle)
    ->Args({20, 15, 3000, 5, 0})
    ->Args({20, 15, 3000, 5, 1})
    ->Args({40, 20, 4000, 6, 0})
    ->Args({40, 20, 4000, 6, 1})
    ->Args({120, 1, 9000, 8, 0})  // dense
    ->Args({121, 1, 9000, 8, 0})  // sparse
    ->Args({1000, 1, 80000, 8, 0})
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace slambed
