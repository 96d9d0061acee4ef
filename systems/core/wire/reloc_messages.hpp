// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <utility>

#include "features/vocabulary.hpp"
#include "wire/direct_text.hpp"
#include "wire/message_type.hpp"
#include "wire/messages.hpp"

namespace slambed::wire {

/// Messages for relocalization on the edge.
inline constexpr MessageRange kRelocMessages(32, {"RELOC_REQUEST", "RELOC_FAIL", "RELOC_OK",
                                                  "SUSPEND", "RESUME"});

/// RELOC_REQUEST, mobile -> edge: a frame to relocalize in the global map.
struct RelocRequest {
  static constexpr MessageType kType = kRelocMessages["RELOC_REQUEST"];
  std::uint64_t number = 0;          ///< counts from 1
  std::uint64_t applied_update = 0;  ///< newest update that the mobile has applied, 0: none
  FrameMessage frame;
};

/// When a request passed each step; run clock.
struct RelocTimes {
  RunTime queued{};    ///< RELOC_REQUEST handed to the channel
  RunTime received{};  ///< its last byte at the edge
};

enum class RelocFailure : std::uint8_t {
  kNotFound = 0,   ///< no candidate keyframe, or no pose with enough inliers
  kNoMap = 1,      ///< the edge has no map
  kUnreadable = 2  ///< the request was not a valid message
};

/// RELOC_FAIL, edge -> mobile.
struct RelocFail {
  static constexpr MessageType kType = kRelocMessages["RELOC_FAIL"];
  std::uint64_t number = 0;
  RelocTimes times;
  RelocFailure reason = RelocFailure::kNotFound;
  std::uint64_t padding = 0;  ///< number of zero bytes at the end
};

/// RELOC_OK, edge -> mobile: the pose of the request's frame.
struct RelocOk {
  static constexpr MessageType kType = kRelocMessages["RELOC_OK"];
  std::uint64_t number = 0;
  RelocTimes times;
  std::uint64_t update = 0;  ///< the answer counts as the map update with this number
  bool jumped = false;       ///< a loop correction moved the map after the mobile's last update
  SE3 T_cw;
  /// Features of the frame with their matched map points, all of which belong to the keyframe.
  std::vector<std::pair<std::uint16_t, MapPointId>> matches;
  MapDelta keyframe;  ///< the reference keyframe with all its points
};

/// SUSPEND, mobile -> edge: tracking is lost. The edge sends no map update until RESUME.
struct SuspendMessage {
  static constexpr MessageType kType = kRelocMessages["SUSPEND"];
  std::uint64_t loss = 0;  ///< counts from 1
};

/// RESUME, mobile -> edge: tracking has recovered.
struct ResumeMessage {
  static constexpr MessageType kType = kRelocMessages["RESUME"];
  std::uint64_t loss = 0;
  KeyFrameId reference{};  ///< reference keyframe of the recovered frame
};

Bytes encode(const RelocRequest& message);
Bytes encode(const RelocFail& message);
Bytes encode(const RelocOk& message);
Bytes encode(const SuspendMessage& message);
Bytes encode(const ResumeMessage& message);
/// Encodes frames and keyframes in the layout of Edge-SLAM's text archives. found: the frame of the
/// request, which is sent back because Edge-SLAM pays for that too.
Bytes encode_text(const RelocRequest& message, const Vocabulary& vocabulary,
                  DirectText* direct = nullptr);
Bytes encode_text(const RelocOk& message, const FrameMessage& found, const Vocabulary& vocabulary,
                  DirectText* direct = nullptr);

/// These throw only DecodeError.
RelocRequest decode_reloc_request(std::span<const std::uint8_t> bytes, const SensorPtr& sensor);
RelocFail decode_reloc_fail(std::span<const std::uint8_t> bytes);
RelocOk decode_reloc_ok(std::span<const std::uint8_t> bytes, const SensorPtr& sensor);
SuspendMessage decode_suspend(std::span<const std::uint8_t> bytes);
ResumeMessage decode_resume(std::span<const std::uint8_t> bytes);
RelocRequest decode_reloc_request_text(std::span<const std::uint8_t> bytes, const SensorPtr& sensor,
                                       DirectText* direct = nullptr);
RelocOk decode_reloc_ok_text(std::span<const std::uint8_t> bytes, const SensorPtr& sensor,
                             DirectText* direct = nullptr);
/// Returns the number of a RELOC_REQUEST even if its rest is unreadable.
std::uint64_t number_of_request(std::span<const std::uint8_t> bytes);

}  // namespace slambed::wire
