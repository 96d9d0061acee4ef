// SPDX-License-Identifier: Apache-2.0
#include "runtime/live/background_load.hpp"

#include <cmath>
#include <string>

#include "runtime/live/pace.hpp"

namespace slambed {
namespace {

/// The load stands for a camera driver, a recording player and a viewer, each of which wakes up
/// some ten times a second.
constexpr Duration kPeriod = std::chrono::milliseconds(20);

}  // namespace

void spawn_background_load(Runtime& runtime, double cores, double share) {
  const int workers = static_cast<int>(std::ceil(cores));
  for (int i = 0; i < workers; ++i) {
    const Duration each(std::llround(share * cores / workers * kPeriod.count()));
    runtime.spawn("background-" + std::to_string(i), [each](Worker& worker) {
      const Duration begin_cpu = thread_cpu_time();
      for (std::int64_t period = 1; !worker.stopping(); ++period) {
        const RunTime next = worker.now() + kPeriod;
        // CPU time that a period did not get is made up for in the next ones, as for queued work.
        burn_until(begin_cpu + period * each, [&] { return worker.stopping(); });
        worker.sleep_until(next);
      }
    });
  }
}

}  // namespace slambed
