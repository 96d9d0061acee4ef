// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

#include "wire/message_type.hpp"
#include "wire/messages.hpp"

namespace slambed::wire {

/// A trip through the map of earlier ones.
inline constexpr MessageRange kTripMessages(48, {"TRIP_START", "INITIAL_POSE", "POSE_UPDATE",
                                                 "TRIP_UPLOAD"});
/// mobile -> edge: KEYFRAME of a trip whose place is not known yet.
inline constexpr MessageType kTripStart = kTripMessages["TRIP_START"];
/// edge -> mobile: where it is.
inline constexpr MessageType kInitialPose = kTripMessages["INITIAL_POSE"];
/// edge -> mobile: where a later keyframe is.
inline constexpr MessageType kPoseUpdate = kTripMessages["POSE_UPDATE"];
/// mobile -> edge: a keyframe that stayed here during the trip.
inline constexpr MessageType kTripUpload = kTripMessages["TRIP_UPLOAD"];

/// INITIAL_POSE and POSE_UPDATE, edge -> mobile: where a keyframe is in the map of earlier trips,
/// and when it passed each place. 59 bytes.
struct PoseAnswer {
  KeyFrameId keyframe;
  std::uint16_t matches = 0;  ///< with points of that map; 0: no match, and the pose means nothing
  SE3 T_cw;                   ///< to a tenth of a millimeter within a kilometer of the origin
  RunTime sent{};             ///< first byte of the KEYFRAME handed to the transport; run clock
  Duration up{}, wait{}, match{}, bundle{};  ///< from there until it came, was looked at ...
};

Bytes encode(const PoseAnswer& message);
/// Throws DecodeError for what cannot be read. Numbers that are no pose can: see defect.
PoseAnswer decode_pose_answer(std::span<const std::uint8_t> bytes);
/// Why this is no pose that may be applied; nothing when it is one.
std::optional<std::string_view> defect(const PoseAnswer& message);

/// A payload with filler behind it, up to a size: what an encoding costs on the way that is larger
/// than ours. The filler is neither looked at nor charged. Eight bytes are added in any case.
Bytes fill_up(Bytes own, std::size_t size);
/// The payload without its filler. Throws DecodeError.
std::span<const std::uint8_t> without_filler(std::span<const std::uint8_t> bytes);

}  // namespace slambed::wire
