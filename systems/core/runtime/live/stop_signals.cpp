// SPDX-License-Identifier: Apache-2.0
#include "runtime/live/stop_signals.hpp"

#include <pthread.h>
#include <signal.h>
#include <time.h>

#include <cerrno>

namespace slambed {
namespace {

sigset_t stop_set() {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGTERM);
  sigaddset(&set, SIGINT);
  return set;
}

constexpr timespec kSignalWait{.tv_sec = 0, .tv_nsec = 100'000'000};

}  // namespace

StopSignals::StopSignals() {
  const sigset_t set = stop_set();
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
  signal(SIGPIPE, SIG_IGN);
}

StopSignals::~StopSignals() = default;

void StopSignals::unwatch() { thread_ = {}; }

void StopSignals::watch(std::function<void()> on_stop) {
  thread_ = std::jthread([on_stop = std::move(on_stop)](const std::stop_token& token) {
    pthread_setname_np(pthread_self(), "signals");
    const sigset_t set = stop_set();
    while (!token.stop_requested()) {
      if (sigtimedwait(&set, nullptr, &kSignalWait) > 0) {
        on_stop();
        return;
      }
    }
  });
}

}  // namespace slambed
