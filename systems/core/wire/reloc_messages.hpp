// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>

#include "features/vocabulary.hpp"
#include "wire/direct_text.hpp"
#include "wire/message_type.hpp"
#include "wire/messages.hpp"

namespace slambed::wire {

/// Relocalization on the edge.
inline constexpr MessageRange kRelocMessages(32, {"RELOC_REQUEST", "RELOC_FAIL", "RELOC_OK",
                                                  "SUSPEND", "RESUME"});

/// RELOC_REQUEST, mobile -> edge: a lost frame, to be found in the global map.
struct RelocRequest {
  static constexpr MessageType kType = kRelocMessages["RELOC_REQUEST"];
  std::uint64_t number = 0;          ///< counts from 1
  std::uint64_t applied_update = 0;  ///< newest update the mobile had applied, 0: none
  FrameMessage frame;
};

/// When a request passed the edge; run clock.
struct RelocTimes {
  RunTime queued{};    ///< RELOC_REQUEST handed to the channel
  RunTime received{};  ///< its last byte at the edge
};

enum class RelocFailure : std::uint8_t {
  kNotFound = 0,   ///< no place looks like it, or none agrees with it
  kNoMap = 1,      ///< the edge has none
  kUnreadable = 2  ///< the request was no valid message
};

/// RELOC_FAIL, edge -> mobile.
struct RelocFail {
  static constexpr MessageType kType = kRelocMessages["RELOC_FAIL"];
  std::uint64_t number = 0;
  RelocTimes times;
  RelocFailure reason = RelocFailure::kNotFound;
  std::uint64_t padding = 0;  ///< bytes without meaning behind it
};

/// RELOC_OK, edge -> mobile: where the frame of the request was taken.
struct RelocOk {
  static constexpr MessageType kType = kRelocMessages["RELOC_OK"];
  std::uint64_t number = 0;
  RelocTimes times;
  std::uint64_t update = 0;  ///< counts as an update with this number: which jumps the map knows of
  bool jumped = false;       ///< the map has moved since the mobile's last update
  SE3 T_cw;
  /// Features of the frame and the points they were matched with; all are points of the keyframe.
  std::vector<std::pair<std::uint16_t, MapPointId>> matches;
  MapDelta keyframe;  ///< the reference keyframe with all its points
};

/// SUSPEND, mobile -> edge: a loss begins. What waits to be sent waits until RESUME.
struct SuspendMessage {
  static constexpr MessageType kType = kRelocMessages["SUSPEND"];
  std::uint64_t loss = 0;  ///< counts from 1
};

/// RESUME, mobile -> edge: the loss has ended.
struct ResumeMessage {
  static constexpr MessageType kType = kRelocMessages["RESUME"];
  std::uint64_t loss = 0;
  KeyFrameId reference{};  ///< keyframe at which the camera was found
};

Bytes encode(const RelocRequest& message);
Bytes encode(const RelocFail& message);
Bytes encode(const RelocOk& message);
Bytes encode(const SuspendMessage& message);
Bytes encode(const ResumeMessage& message);
/// Frames and keyframes as Edge-SLAM's text archives have them. found: the frame of the request,
/// which goes back whole for what that costs.
Bytes encode_text(const RelocRequest& message, const Vocabulary& vocabulary,
                  DirectText* direct = nullptr);
Bytes encode_text(const RelocOk& message, const FrameMessage& found, const Vocabulary& vocabulary,
                  DirectText* direct = nullptr);

/// All throw DecodeError and nothing else.
RelocRequest decode_reloc_request(std::span<const std::uint8_t> bytes, const SensorPtr& sensor);
RelocFail decode_reloc_fail(std::span<const std::uint8_t> bytes);
RelocOk decode_reloc_ok(std::span<const std::uint8_t> bytes, const SensorPtr& sensor);
SuspendMessage decode_suspend(std::span<const std::uint8_t> bytes);
ResumeMessage decode_resume(std::span<const std::uint8_t> bytes);
RelocRequest decode_reloc_request_text(std::span<const std::uint8_t> bytes, const SensorPtr& sensor,
                                       DirectText* direct = nullptr);
RelocOk decode_reloc_ok_text(std::span<const std::uint8_t> bytes, const SensorPtr& sensor,
                             DirectText* direct = nullptr);
/// The number of a RELOC_REQUEST whose rest cannot be read.
std::uint64_t number_of_request(std::span<const std::uint8_t> bytes);

}  // namespace slambed::wire
