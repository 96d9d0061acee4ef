// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <optional>
#include <utility>

#include "runtime/channel.hpp"

namespace slambed {

/// Pushes to a queue of limited length (0: unlimited). If the queue was full, removes and returns
/// the oldest message; the caller records the drop.
inline std::optional<Message> push_drop_oldest(std::deque<Message>& queue, Message message,
                                               int limit) {
  std::optional<Message> dropped;
  if (limit > 0 && queue.size() >= static_cast<std::size_t>(limit)) {
    dropped = std::move(queue.front());
    queue.pop_front();
  }
  queue.push_back(std::move(message));
  return dropped;
}

}  // namespace slambed
