// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string_view>
#include <type_traits>
#include <utility>

#include "runtime/channel.hpp"
#include "runtime/observer.hpp"
#include "wire/byte_io.hpp"
#include "wire/message_type.hpp"

namespace slambed {

/// Size of a message as work units of a stage.
inline double kilobytes(const Bytes& bytes) { return static_cast<double>(bytes.size()) / 1000; }

inline bool is(const Message& message, wire::MessageType type) {
  return message.type == wire::type_of(type);
}

/// Sends a payload with a type; returns the message's sequence number.
inline std::uint64_t send(Channel& channel, wire::MessageType type, Bytes payload = {}) {
  return channel.send(wire::type_of(type), std::move(payload));
}
/// The same for a message class, which has one type.
template <typename M>
std::uint64_t send(Channel& channel, const M& message) {
  return send(channel, M::kType, encode(message));
}

/// Refuses a message that cannot be decoded: counts it and logs its type and the error.
void refuse(Observer& observer, const Message& message, const wire::DecodeError& error);

/// Returns decode(payload), or nothing after refusing the message if that throws DecodeError.
template <typename Decode>
auto read(Observer& observer, const Message& message, Decode&& decode)
    -> std::optional<std::invoke_result_t<Decode, const Bytes&>> {
  try {
    return std::forward<Decode>(decode)(message.payload);
  } catch (const wire::DecodeError& error) {
    refuse(observer, message, error);
    return std::nullopt;
  }
}

/// The same within a stage, whose n1 is the size in kilobytes.
template <typename Decode>
auto read(Worker& worker, std::string_view stage, Observer& observer, const Message& message,
          Decode&& decode) {
  return worker.stage(stage, [&](StageUnits& units) {
    units.n1 = kilobytes(message.payload);
    return read(observer, message, std::forward<Decode>(decode));
  });
}

/// Dispatches a channel's messages to handlers by type.
class Inbox {
 public:
  explicit Inbox(Observer& observer) : observer_(observer) {}

  /// Calls handle(Message&) with the raw message, which it may move from.
  template <typename Handle>
  Inbox& on(wire::MessageType type, Handle handle) {
    handlers_[wire::type_of(type)] = std::move(handle);
    return *this;
  }
  /// Calls handle(decoded, message) with the result of decode(payload).
  template <typename M, typename Decode, typename Handle>
  Inbox& on(Decode decode, Handle handle) {
    return on(M::kType,
              [this, decode = std::move(decode), handle = std::move(handle)](Message& message) {
                if (const auto read_well = read(observer_, message, decode))
                  handle(*read_well, message);
              });
  }
  /// False for a type without a handler.
  bool dispatch(Message message) const {
    const auto handler = handlers_.find(message.type);
    if (handler == handlers_.end()) return false;
    handler->second(message);
    return true;
  }

 private:
  Observer& observer_;
  std::map<std::uint8_t, std::function<void(Message&)>> handlers_;
};

}  // namespace slambed
