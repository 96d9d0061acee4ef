// SPDX-License-Identifier: Apache-2.0
#include "apps/pace/busy.hpp"

#include <pthread.h>
#include <time.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <thread>

#include "apps/pace/workload.hpp"

namespace slambed::pace {
namespace {

constexpr int kCheckedUnits = 100;
constexpr double kLongFreezeS = 10e-3;

double seconds_on(clockid_t clock) {
  timespec at{};
  clock_gettime(clock, &at);
  return static_cast<double>(at.tv_sec) + static_cast<double>(at.tv_nsec) * 1e-9;
}

double cpu_now() { return seconds_on(CLOCK_THREAD_CPUTIME_ID); }
double wall_now() { return seconds_on(CLOCK_MONOTONIC); }

BusyThread be_busy(const BusyOptions& options, double start_s) {
  BusyThread result;
  Workload work;
  for (int i = 0; i < kCheckedUnits; ++i) work.unit();
  result.checksum = work.checksum();
  while (wall_now() < start_s) work.unit();

  const double began_s = wall_now();
  const double cpu_began_s = cpu_now();
  double last_s = began_s;
  long units = 0;
  while (last_s < began_s + options.seconds) {
    work.unit();
    ++units;
    const double now_s = wall_now();
    const double gap_s = now_s - last_s;
    result.longest_freeze_ms = std::max(result.longest_freeze_ms, gap_s * 1e3);
    result.freezes_over_10_ms += gap_s > kLongFreezeS ? 1 : 0;
    last_s = now_s;
  }
  const double cpu_s = cpu_now() - cpu_began_s;
  result.units_per_s = static_cast<double>(units) / (last_s - began_s);
  result.units_per_cpu_s = static_cast<double>(units) / cpu_s;
  result.cpu_share = cpu_s / (last_s - began_s);
  return result;
}

}  // namespace

std::vector<BusyThread> measure_busy(const BusyOptions& options) {
  std::vector<BusyThread> results(static_cast<std::size_t>(options.threads));
  const double start_s = wall_now() + options.settle_s;
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < results.size(); ++i) {
    threads.emplace_back([&options, &results, start_s, i] {
      pthread_setname_np(pthread_self(), ("busy-" + std::to_string(i)).c_str());
      results[i] = be_busy(options, start_s);
    });
  }
  for (auto& thread : threads) thread.join();
  return results;
}

std::string busy_json(const BusyOptions& options, const std::vector<BusyThread>& threads) {
  nlohmann::json list = nlohmann::json::array();
  for (const auto& thread : threads) {
    list.push_back({{"units_per_s", thread.units_per_s},
                    {"units_per_cpu_s", thread.units_per_cpu_s},
                    {"cpu_share", thread.cpu_share},
                    {"longest_freeze_ms", thread.longest_freeze_ms},
                    {"freezes_over_10_ms", thread.freezes_over_10_ms},
                    {"checksum", thread.checksum}});
  }
  return nlohmann::json{{"workload", 1}, {"seconds", options.seconds}, {"threads", list}}.dump(1);
}

}  // namespace slambed::pace
