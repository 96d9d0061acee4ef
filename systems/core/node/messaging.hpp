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

/// Size of a message as a stage counts it.
inline double kilobytes(const Bytes& bytes) { return static_cast<double>(bytes.size()) / 1000; }

inline bool is(const Message& message, wire::MessageType type) {
  return message.type == wire::type_of(type);
}

/// Sends a payload under a type; returns the message's sequence.
inline std::uint64_t send(Channel& channel, wire::MessageType type, Bytes payload = {}) {
  return channel.send(wire::type_of(type), std::move(payload));
}
/// The same for messages of which there is one type.
template <typename M>
std::uint64_t send(Channel& channel, const M& message) {
  return send(channel, M::kType, encode(message));
}

/// The one place that refuses what cannot be read: counts it, and says what it was and why.
void refuse(Observer& observer, const Message& message, const wire::DecodeError& error);

/// What decode(payload) makes of a message; nothing where that throws DecodeError: then it was
/// refused.
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

/// Hands each message of a channel to whom it is for.
class Inbox {
 public:
  explicit Inbox(Observer& observer) : observer_(observer) {}

  /// handle(Message&): as it came, and may be moved from.
  template <typename Handle>
  Inbox& on(wire::MessageType type, Handle handle) {
    handlers_[wire::type_of(type)] = std::move(handle);
    return *this;
  }
  /// handle(M, message) of what decode(payload) made of it.
  template <typename M, typename Decode, typename Handle>
  Inbox& on(Decode decode, Handle handle) {
    return on(M::kType,
              [this, decode = std::move(decode), handle = std::move(handle)](Message& message) {
                if (const auto read_well = read(observer_, message, decode))
                  handle(*read_well, message);
              });
  }
  /// False for a type that nobody asked for.
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
