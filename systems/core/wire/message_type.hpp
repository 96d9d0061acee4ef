// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string_view>

namespace slambed::wire {

/// Version of every payload layout below this folder; both nodes must have the same.
inline constexpr std::uint16_t kWireVersion = 7;
/// Version of put_delta's layout alone, which stored maps have too.
inline constexpr std::uint16_t kDeltaVersion = 4;

/// Message::type. Numbers are never reused.
enum class MessageType : std::uint8_t {
  kKeyFrame = 1,         ///< mobile -> edge: a keyframe with its new points
  kMapUpdate = 2,        ///< edge -> mobile: keyframes and points that become the local map
  kFrame = 3,            ///< mobile -> edge: a frame that needs relocalisation
  kRelocMap = 4,         ///< edge -> mobile: MAP_UPDATE with the candidates
  kAck = 5,              ///< receiver -> sender: a message arrived
  kProbe = 6,            ///< keeps RTT samples coming; content is ignored
  kBye = 7,              ///< last message of a node
  kPoses = 8,            ///< edge -> mobile: where all keyframes ended up
  kAnnounce = 9,         ///< sender -> receiver: a message of this size wants to come
  kKeyFrameWanted = 10,  ///< edge -> mobile: there is no map yet that a keyframe could join
  // DynNetSLAM
  kState = 16,
  kStart = 17,
  kStop = 18,
  kMapHandover = 19,
  kHandoverAck = 20,
  // Relocalisation on the edge
  kRelocRequest = 32,  ///< mobile -> edge: find this frame in the global map
  kRelocFail = 33,     ///< edge -> mobile: it is not there
  kRelocOk = 34,       ///< edge -> mobile: where it was taken, and a keyframe to go on from
  kSuspend = 35,       ///< mobile -> edge: tracking is lost, no more updates
  kResume = 36,        ///< mobile -> edge: tracking goes on
  // CloudSLAM
  kTripStart = 48,    ///< mobile -> edge: KEYFRAME of a trip whose place is not known yet
  kInitialPose = 49,  ///< edge -> mobile: where it is
  kPoseUpdate = 50,   ///< edge -> mobile: where a later keyframe is
  kTripUpload = 51,   ///< mobile -> edge: a keyframe that stayed here during the trip
  // Semantic edgeSLAM
  kFrameImage = 64,   ///< mobile -> edge: a picture to be tracked there
  kFrameResult = 65,  ///< edge -> mobile: its pose, what moves in it, and how long each part took
  kSemanticKeyFrame = 66,  ///< mobile -> edge: a keyframe to be mapped, its picture to be segmented
  kOptResult = 67,        ///< edge -> mobile: its optimised pose, and what changed in the local map
  kMask = 68,             ///< edge -> mobile: what moves in its picture
  kNoMask = 69,           ///< edge -> mobile: nobody will ever say
  kKeyFrameRefused = 70,  ///< edge -> mobile: an upload could not be read
};

/// As it stands in a message's header.
constexpr std::uint8_t type_of(MessageType type) { return static_cast<std::uint8_t>(type); }

/// "KEYFRAME", "MAP_UPDATE" ...; "UNKNOWN" for numbers that name nothing.
std::string_view message_name(std::uint8_t type);

}  // namespace slambed::wire
