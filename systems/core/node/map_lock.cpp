// SPDX-License-Identifier: Apache-2.0
#include "node/map_lock.hpp"

namespace slambed {

void MapLock::acquire(Worker& worker, std::string_view who) {
  const RunTime begin = worker.now();
  while (!worker.stopping()) {
    const auto ticket = released_->ticket();  // before the check, so no release is missed
    if (!held_.exchange(true)) break;
    worker.wait(*released_, ticket, kNever);
  }
  const Duration waited = worker.now() - begin;
  // In a live run even a free lock takes a few microseconds.
  if (waited > std::chrono::microseconds(50))
    log_.write(JsonLine("map_wait").add("worker", who).add_ms("wait_ms", waited));
}

void MapLock::release() {
  held_ = false;
  released_->notify();
}

}  // namespace slambed
