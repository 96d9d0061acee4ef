// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "wire/message_type.hpp"
#include "wire/messages.hpp"

namespace slambed::wire {

/// Where mapping runs, and the map on its way there.
///
/// An epoch in these messages counts how often mapping has changed its place: it is the generation
/// of the map that both nodes go by, and what was made in an older one is declined.
inline constexpr MessageRange kHandoverMessages(16, {"STATE", "START", "STOP", "MAP_HANDOVER",
                                                     "HANDOVER_ACK"});

/// STATE, mobile -> edge: where mapping runs now. Repeated while nothing changes; the edge answers
/// each with an ACK, so both know that the other is alive.
struct StateMessage {
  static constexpr MessageType kType = kHandoverMessages["STATE"];
  std::uint8_t state = 0;  ///< the system's own number
  std::uint64_t epoch = 0;
  RunTime time{};
  std::optional<Duration> rtt;  ///< absent while unknown
};

/// STOP, mobile -> edge: mapping rests; what the edge sends of an older epoch is worthless.
struct StopMessage {
  static constexpr MessageType kType = kHandoverMessages["STOP"];
  std::uint64_t epoch = 0;
};

/// START, mobile -> edge: map again on the map as it is. Answered by a HANDOVER_ACK.
struct StartMessage {
  static constexpr MessageType kType = kHandoverMessages["START"];
  std::uint64_t epoch = 0;
  std::uint64_t number = 0;  ///< shared with MAP_HANDOVER, counts from 1
};

/// MAP_HANDOVER, mobile -> edge: START with what has changed since the edge knew the map last.
struct MapHandover {
  static constexpr MessageType kType = kHandoverMessages["MAP_HANDOVER"];
  std::uint64_t epoch = 0;
  std::uint64_t number = 0;
  bool whole = false;  ///< needs no earlier map at the edge
  MapDelta changes;
};

enum class HandoverAnswer : std::uint8_t {
  kDeclined,  ///< there is no map to change, or this one cannot be read: a whole one is needed
  kAccepted,
  kNoMap,  ///< to STATE, which no number goes with: the edge has no map at all
};

/// HANDOVER_ACK, edge -> mobile.
struct HandoverAck {
  static constexpr MessageType kType = kHandoverMessages["HANDOVER_ACK"];
  std::uint64_t epoch = 0;
  std::uint64_t number = 0;
  HandoverAnswer answer = HandoverAnswer::kDeclined;
};

Bytes encode(const StateMessage& message);
Bytes encode(const StopMessage& message);
Bytes encode(const StartMessage& message);
Bytes encode(const MapHandover& message);
Bytes encode(const HandoverAck& message);

/// All throw DecodeError and nothing else.
StateMessage decode_state(std::span<const std::uint8_t> bytes);
StopMessage decode_stop(std::span<const std::uint8_t> bytes);
StartMessage decode_start(std::span<const std::uint8_t> bytes);
MapHandover decode_handover(std::span<const std::uint8_t> bytes, const SensorPtr& sensor);
HandoverAck decode_handover_ack(std::span<const std::uint8_t> bytes);

/// Which hand-over a MAP_HANDOVER is that cannot be read; nothing where that cannot be read either.
std::optional<StartMessage> handover_head(std::span<const std::uint8_t> bytes);

}  // namespace slambed::wire
