// SPDX-License-Identifier: Apache-2.0
#include "apps/pace/metronome.hpp"

#include <pthread.h>
#include <sched.h>
#include <sys/prctl.h>
#include <time.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <iostream>
#include <nlohmann/json.hpp>
#include <thread>

#include "base/error.hpp"

namespace slambed::pace {
namespace {

constexpr long kNsPerSecond = 1'000'000'000;
constexpr unsigned long kSlackNs = 1;

void tick(const MetronomeOptions& options, const std::atomic<bool>& stopped) {
  prctl(PR_SET_TIMERSLACK, kSlackNs);
  timespec due{};
  clock_gettime(CLOCK_MONOTONIC, &due);
  while (!stopped.load(std::memory_order_relaxed)) {
    due.tv_nsec += options.period_us * 1000;
    while (due.tv_nsec >= kNsPerSecond) {
      due.tv_nsec -= kNsPerSecond;
      ++due.tv_sec;
    }
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, nullptr);
  }
}

void bind(pthread_t thread, int cpu) {
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(static_cast<std::size_t>(cpu), &set);
  if (const int error = pthread_setaffinity_np(thread, sizeof(set), &set); error != 0) {
    throw bad_input("cannot run on CPU " + std::to_string(cpu) + ": " + std::strerror(error) +
                    ", --cpus, give CPUs of this host");
  }
}

}  // namespace

void run_metronome(const MetronomeOptions& options) {
  sched_param parameters{};
  parameters.sched_priority = options.fifo_priority;
  // Threads that start later inherit the priority.
  const bool real_time = sched_setscheduler(0, SCHED_FIFO, &parameters) == 0;

  // Checks all CPUs before any thread starts, so that an error leaves no thread behind.
  const pthread_t self = pthread_self();
  for (const int cpu : options.cpus) bind(self, cpu);

  std::atomic<bool> stopped = false;
  std::vector<std::thread> threads;
  for (const int cpu : options.cpus) {
    threads.emplace_back([&options, &stopped] { tick(options, stopped); });
    bind(threads.back().native_handle(), cpu);
  }
  std::cout << nlohmann::json{{"ready", true}, {"real_time", real_time}}.dump() << std::endl;
  std::array<char, 64> ignored;
  while (true) {
    const ssize_t size = read(STDIN_FILENO, ignored.data(), ignored.size());
    if (size == 0 || (size < 0 && errno != EINTR)) break;
  }
  stopped = true;
  for (auto& thread : threads) thread.join();
}

}  // namespace slambed::pace
