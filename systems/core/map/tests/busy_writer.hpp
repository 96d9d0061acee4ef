// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <functional>
#include <thread>

#include "map/map.hpp"

namespace slambed::testing {

/// Commits again and again on a thread of its own, as tracking and mapping do while something else
/// looks at the whole map.
class BusyWriter {
 public:
  /// change: of the map, given a number that grows.
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

  /// Repeats until held() or a minute is over; the last answer of held().
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
