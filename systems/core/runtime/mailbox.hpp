// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "runtime/runtime.hpp"

namespace slambed {

/// Queue between two workers of one node. A bounded mailbox drops the oldest item when full and
/// hands it back, so that the caller can record the drop ("newest wins" with capacity 1).
template <typename Item>
class Mailbox {
 public:
  explicit Mailbox(Runtime& runtime, std::size_t capacity = 0)
      : signal_(runtime.make_signal()), capacity_(capacity) {}

  std::optional<Item> put(Item item) {
    std::optional<Item> dropped;
    {
      std::lock_guard lock(mutex_);
      if (capacity_ != 0 && items_.size() >= capacity_) {
        dropped = std::move(items_.front());
        items_.pop_front();
      }
      items_.push_back(std::move(item));
    }
    signal_->notify();
    return dropped;
  }

  std::optional<Item> try_take() {
    std::lock_guard lock(mutex_);
    if (items_.empty()) return std::nullopt;
    std::optional<Item> item(std::move(items_.front()));
    items_.pop_front();
    return item;
  }

  /// Waits for an item. Returns nothing at the deadline or when the run stops.
  std::optional<Item> take(Worker& worker, RunTime deadline = kNever) {
    for (;;) {
      const auto ticket = signal_->ticket();
      if (auto item = try_take()) return item;
      if (worker.stopping() || worker.now() >= deadline) return std::nullopt;
      worker.wait(*signal_, ticket, deadline);
    }
  }

  std::size_t size() const {
    std::lock_guard lock(mutex_);
    return items_.size();
  }
  Signal& signal() { return *signal_; }

 private:
  std::unique_ptr<Signal> signal_;
  std::size_t capacity_;
  mutable std::mutex mutex_;
  std::deque<Item> items_;
};

}  // namespace slambed
