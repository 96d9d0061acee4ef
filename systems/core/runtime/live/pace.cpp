// SPDX-License-Identifier: Apache-2.0
#include "runtime/live/pace.hpp"

#include <time.h>

#include <cmath>
#include <utility>

#include "base/error.hpp"

namespace slambed {
namespace {

/// An excess below this comes from clock reads and bookkeeping and does not count as missed.
constexpr Duration kUnnoticed = std::chrono::microseconds(100);
/// Iterations between two reads of the thread's clock, each a system call: a few microseconds.
constexpr int kSpins = 4000;

void spin() {
  for (int i = 0; i < kSpins; ++i) asm volatile("");
}

}  // namespace

Duration thread_cpu_time() {
  timespec ts{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &ts);
  return std::chrono::seconds(ts.tv_sec) + Duration(ts.tv_nsec);
}

void burn_until(Duration thread_cpu, const std::function<bool()>& over) {
  while (thread_cpu_time() < thread_cpu && !over()) spin();
}

Pace::Pace(PaceOptions options) : options_(std::move(options)) {
  options_.device.check();
  if (!(options_.share > 0 && options_.share <= 1))
    throw bad_input("pace: share must be above 0, at most 1");
}

PacedStage Pace::hold(std::string_view stage, const StageUnits& units, const Begin& begin,
                      const Surroundings& around) {
  const Duration work = thread_cpu_time() - begin.cpu;
  const Duration charged = charge(stage, units);
  const RunTime end = begin.start + charged;
  const bool on_core = options_.device.cost(stage).accelerator.empty();
  const Duration of_cpu(std::llround(options_.share * static_cast<double>(charged.count())));
  const bool missed = on_core ? work > of_cpu + kUnnoticed : around.now() > end + kUnnoticed;
  if (on_core) burn_until(begin.cpu + of_cpu, around.stopping);
  if (around.now() < end) around.sleep_until(end);
  return {.charged = charged, .work = work, .missed = missed};
}

Duration Pace::charge(std::string_view stage, const StageUnits& units) {
  std::uint64_t count = 0;
  {
    const std::lock_guard lock(mutex_);
    count = executions_.try_emplace(std::string(stage), 0).first->second++;
  }
  return options_.device.charge(stage, units, options_.seed, count);
}

}  // namespace slambed
