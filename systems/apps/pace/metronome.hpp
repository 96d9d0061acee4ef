// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

namespace slambed::pace {

struct MetronomeOptions {
  std::vector<int> cpus;
  std::int64_t period_us = 1000;
  int fifo_priority = 1;
};

/// Interrupts each of the CPUs once per period until standard input ends.
///
/// The kernel checks a group's quota only at scheduler ticks and when another thread takes the CPU.
/// With a tick of 4 ms (CONFIG_HZ=250), a thread that may run 2.5 of every 10 ms runs 4 ms and is
/// then throttled for 16 ms. A metronome thread that takes the CPU for a few microseconds
/// every millisecond makes the kernel check that often.
///
/// When it runs, it prints one line that says whether it has real-time priority. Without that
/// priority the interrupts are delayed by the scheduler and help little.
void run_metronome(const MetronomeOptions& options);

}  // namespace slambed::pace
