// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <thread>

#include "map/map.hpp"

namespace slambed::testing {

/// Commits continuously on its own thread, as tracking and mapping do while another module reads
/// the whole map.
class BusyWriter {
 public:
  /// change: returns the next delta, given a counter.
  BusyWriter(Map& map, std::function<MapDelta(std::uint32_t)> change)
      : thread_([this, &map, change = std::move(change)] {
          for (std::uint32_t number = 1; !done_; ++number) {
            map.commit(change(number));
            ++commits_;
            std::this_thread::yield();
          }
        }) {}
  ~BusyWriter() {
    done_ = true;
    thread_.join();
  }

  int commits() const { return commits_; }

  /// Repeats until held() is true or a minute has passed; returns whether it became true.
  static bool until(const std::function<bool()>& held) {
    const auto begin = std::chrono::steady_clock::now();
    while (std::chrono::steady_clock::now() - begin < std::chrono::minutes(1))
      if (held()) return true;
    return false;
  }

 private:
  std::atomic<int> commits_{0};
  std::atomic<bool> done_{false};
  std::thread thread_;
};

}  // namespace slambed::testing
