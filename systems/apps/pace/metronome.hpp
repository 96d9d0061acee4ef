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

/// Interrupts each of the CPUs once per period, until standard input ends.
///
/// The kernel looks whether a group has used its quota when its scheduler tick comes or when
/// another thread takes the CPU. A tick is 4 ms on most kernels (CONFIG_HZ=250): a thread that may
/// run 2.5 of every 10 ms runs 4 and then pays with a freeze of 16. A thread of ours that takes the
/// CPU for a few microseconds every millisecond makes it look that often.
///
/// Prints one line when it is running: whether it has real-time priority. Without it the interrupts
/// come only when the scheduler grants them, and help little.
void run_metronome(const MetronomeOptions& options);

}  // namespace slambed::pace
