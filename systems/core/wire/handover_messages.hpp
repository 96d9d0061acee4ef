// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "wire/message_type.hpp"
#include "wire/messages.hpp"

namespace slambed::wire {

/// Messages that move mapping, with the map, between mobile and edge.
///
/// The epoch counts how often mapping has moved. Both nodes use it as the generation of the map and
/// decline what was made in an older one.
inline constexpr MessageRange kHandoverMessages(16, {"STATE", "START", "STOP", "MAP_HANDOVER",
                                                     "HANDOVER_ACK"});

/// STATE, mobile -> edge: where mapping runs now. It is repeated periodically and the edge answers
/// each one with an ACK, so that both nodes know that the peer is alive.
struct StateMessage {
  static constexpr MessageType kType = kHandoverMessages["STATE"];
  std::uint8_t state = 0;  ///< defined by the system
  std::uint64_t epoch = 0;
  RunTime time{};
  std::optional<Duration> rtt;  ///< absent while unknown
};

/// STOP, mobile -> edge: stop mapping. What the edge sends from an older epoch is ignored.
struct StopMessage {
  static constexpr MessageType kType = kHandoverMessages["STOP"];
  std::uint64_t epoch = 0;
};

/// START, mobile -> edge: resume mapping on the map that the edge has. The edge answers with a
/// HANDOVER_ACK.
struct StartMessage {
  static constexpr MessageType kType = kHandoverMessages["START"];
  std::uint64_t epoch = 0;
  std::uint64_t number = 0;  ///< counts STARTs and MAP_HANDOVERs together, from 1
};

/// MAP_HANDOVER, mobile -> edge: a START with the changes to the map that the edge has not seen.
struct MapHandover {
  static constexpr MessageType kType = kHandoverMessages["MAP_HANDOVER"];
  std::uint64_t epoch = 0;
  std::uint64_t number = 0;
  bool whole = false;  ///< contains the whole map, so the edge needs no earlier one
  MapDelta changes;
};

enum class HandoverAnswer : std::uint8_t {
  kDeclined,  ///< the edge has no map to change, or the message is unreadable: send a whole map
  kAccepted,
  kNoMap,  ///< answers a STATE, with number 0: the edge has no map
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

/// These throw only DecodeError.
StateMessage decode_state(std::span<const std::uint8_t> bytes);
StopMessage decode_stop(std::span<const std::uint8_t> bytes);
StartMessage decode_start(std::span<const std::uint8_t> bytes);
MapHandover decode_handover(std::span<const std::uint8_t> bytes, const SensorPtr& sensor);
HandoverAck decode_handover_ack(std::span<const std::uint8_t> bytes);

/// Returns epoch and number of a MAP_HANDOVER whose rest is unreadable, or nothing if these are
/// unreadable too.
std::optional<StartMessage> handover_head(std::span<const std::uint8_t> bytes);

}  // namespace slambed::wire
