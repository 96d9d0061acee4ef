// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <utility>

#include "runtime/runtime.hpp"

namespace slambed {

/// Handle on a request to a worker: the caller may poll it, wait for it, or ignore it. Must not
/// outlive the worker's owner.
class Completion {
 public:
  using Test = std::function<bool()>;

  /// signal: notified after each change of done() or cannot_complete().
  Completion(Signal& signal, Test done, Test cannot_complete)
      : signal_(&signal), done_(std::move(done)), cannot_complete_(std::move(cannot_complete)) {}

  bool done() const { return done_(); }
  /// True once it is done; false when it cannot complete (mapping is parked), at the deadline or
  /// when the run stops.
  bool wait(Worker& worker, RunTime deadline = kNever) const {
    for (;;) {
      const auto ticket = signal_->ticket();  // before the check, so no notify is missed
      if (done_()) return true;
      if (cannot_complete_() || worker.stopping() || worker.now() >= deadline) return false;
      worker.wait(*signal_, ticket, deadline);
    }
  }

 private:
  Signal* signal_;
  Test done_, cannot_complete_;
};

}  // namespace slambed
