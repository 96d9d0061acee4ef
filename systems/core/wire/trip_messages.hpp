// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

#include "wire/message_type.hpp"
#include "wire/messages.hpp"

namespace slambed::wire {

/// Messages of a trip through the map of earlier trips.
inline constexpr MessageRange kTripMessages(48, {"TRIP_START", "INITIAL_POSE", "POSE_UPDATE",
                                                 "TRIP_UPLOAD"});
/// mobile -> edge: a KEYFRAME of a trip that is not yet located in that map.
inline constexpr MessageType kTripStart = kTripMessages["TRIP_START"];
/// edge -> mobile: the pose of the TRIP_START keyframe.
inline constexpr MessageType kInitialPose = kTripMessages["INITIAL_POSE"];
/// edge -> mobile: the pose of a later keyframe.
inline constexpr MessageType kPoseUpdate = kTripMessages["POSE_UPDATE"];
/// mobile -> edge: a keyframe that the mobile did not send during the trip.
inline constexpr MessageType kTripUpload = kTripMessages["TRIP_UPLOAD"];

/// INITIAL_POSE and POSE_UPDATE, edge -> mobile: the pose of a keyframe in the map of earlier
/// trips, and how long each step took. 59 bytes.
struct PoseAnswer {
  KeyFrameId keyframe;
  std::uint16_t matches = 0;  ///< with points of that map; 0: not matched, the pose is invalid
  SE3 T_cw;                   ///< accurate to 0.1 mm within 1 km of the origin
  RunTime sent{};             ///< first byte of the KEYFRAME handed to the transport; run clock
  Duration up{}, wait{}, match{}, bundle{};  ///< uplink, queue, matching, bundle adjustment
};

Bytes encode(const PoseAnswer& message);
/// Throws DecodeError for unreadable bytes, but accepts an invalid pose: see defect().
PoseAnswer decode_pose_answer(std::span<const std::uint8_t> bytes);
/// Returns the reason why the pose must not be applied, or nothing.
std::optional<std::string_view> defect(const PoseAnswer& message);

/// Pads a payload to a size, to model the traffic of a larger encoding. The receiver ignores the
/// filler, and no cost is charged for it. Eight bytes of header are always added.
Bytes fill_up(Bytes own, std::size_t size);
/// Returns the payload without its filler. Throws DecodeError.
std::span<const std::uint8_t> without_filler(std::span<const std::uint8_t> bytes);

}  // namespace slambed::wire
