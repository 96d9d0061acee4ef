// SPDX-License-Identifier: Apache-2.0
#include "wire/message_type.hpp"

namespace slambed::wire {

std::string_view message_name(std::uint8_t type) {
  switch (static_cast<MessageType>(type)) {
    case MessageType::kKeyFrame:
      return "KEYFRAME";
    case MessageType::kMapUpdate:
      return "MAP_UPDATE";
    case MessageType::kFrame:
      return "FRAME";
    case MessageType::kRelocMap:
      return "RELOC_MAP";
    case MessageType::kAck:
      return "ACK";
    case MessageType::kProbe:
      return "PROBE";
    case MessageType::kBye:
      return "BYE";
    case MessageType::kPoses:
      return "POSES";
    case MessageType::kAnnounce:
      return "ANNOUNCE";
    case MessageType::kKeyFrameWanted:
      return "KEYFRAME_WANTED";
    case MessageType::kState:
      return "STATE";
    case MessageType::kStart:
      return "START";
    case MessageType::kStop:
      return "STOP";
    case MessageType::kMapHandover:
      return "MAP_HANDOVER";
    case MessageType::kHandoverAck:
      return "HANDOVER_ACK";
    case MessageType::kRelocRequest:
      return "RELOC_REQUEST";
    case MessageType::kRelocFail:
      return "RELOC_FAIL";
    case MessageType::kRelocOk:
      return "RELOC_OK";
    case MessageType::kSuspend:
      return "SUSPEND";
    case MessageType::kResume:
      return "RESUME";
    case MessageType::kTripStart:
      return "TRIP_START";
    case MessageType::kInitialPose:
      return "INITIAL_POSE";
    case MessageType::kPoseUpdate:
      return "POSE_UPDATE";
    case MessageType::kTripUpload:
      return "TRIP_UPLOAD";
    case MessageType::kFrameImage:
      return "FRAME_IMAGE";
    case MessageType::kFrameResult:
      return "FRAME_RESULT";
    case MessageType::kSemanticKeyFrame:
      return "SEMANTIC_KEYFRAME";
    case MessageType::kOptResult:
      return "OPT_RESULT";
    case MessageType::kMask:
      return "MASK";
    case MessageType::kNoMask:
      return "NO_MASK";
    case MessageType::kKeyFrameRefused:
      return "KEYFRAME_REFUSED";
  }
  return "UNKNOWN";
}

}  // namespace slambed::wire
