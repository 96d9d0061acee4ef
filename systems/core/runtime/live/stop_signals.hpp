// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <thread>

namespace slambed {

/// Turns SIGTERM and SIGINT into a call on an ordinary thread. Create it before any other thread,
/// so that all of them inherit the blocked mask.
class StopSignals {
 public:
  StopSignals();
  ~StopSignals();
  StopSignals(const StopSignals&) = delete;
  StopSignals& operator=(const StopSignals&) = delete;

  /// Calls on_stop once, at the first signal, even if the signal came before this call.
  void watch(std::function<void()> on_stop);
  /// After it returns, on_stop is not called any more.
  void unwatch();

 private:
  std::jthread thread_;
};

}  // namespace slambed
