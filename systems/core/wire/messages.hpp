// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "base/time.hpp"
#include "map/map_delta.hpp"
#include "wire/byte_io.hpp"
#include "wire/message_type.hpp"

namespace slambed::wire {

/// Messages of every system with an edge.
inline constexpr MessageRange kOffloadMessages(1, {"KEYFRAME", "MAP_UPDATE", "FRAME", "RELOC_MAP",
                                                   "ACK", "PROBE", "BYE", "POSES", "ANNOUNCE",
                                                   "KEYFRAME_WANTED"});
inline constexpr MessageType kKeyFrame = kOffloadMessages["KEYFRAME"];
inline constexpr MessageType kMapUpdate = kOffloadMessages["MAP_UPDATE"];
/// edge -> mobile: a MAP_UPDATE with the relocalization candidates.
inline constexpr MessageType kRelocMap = kOffloadMessages["RELOC_MAP"];
/// Produces RTT samples; its content is ignored.
inline constexpr MessageType kProbe = kOffloadMessages["PROBE"];
/// edge -> mobile: the final poses of all keyframes.
inline constexpr MessageType kPoses = kOffloadMessages["POSES"];
/// edge -> mobile: the edge has no map that a keyframe could join.
inline constexpr MessageType kKeyFrameWanted = kOffloadMessages["KEYFRAME_WANTED"];

using SensorPtr = std::shared_ptr<const Sensor>;

/// KEYFRAME, mobile -> edge.
struct KeyFrameMessage {
  KeyFrameId keyframe;
  RunTime captured{};                 ///< when playback offered its frame
  bool urgent = false;                ///< Edge-SLAM's flag 2: c1c holds, the mapper may be busy
  bool first = false;                 ///< starts a new map, or a trip in a stored map
  bool whole = false;                 ///< contains all observed points: a map can start with it
  bool after_relocalization = false;  ///< within max_frames of one (Edge-SLAM: passedF is false)
  std::uint64_t applied_update = 0;   ///< newest update that the mobile has applied, 0: none
  /// Newest point from an edge mapper that the mobile ever saw. A restarted edge continues its ids
  /// after it.
  MapPointId newest_edge_point{};
  MapDelta delta;
};

/// When the newest keyframe of an update passed each step; run clock.
struct UpdateTimes {
  RunTime captured{};  ///< frame offered on the mobile
  RunTime queued{};    ///< KEYFRAME handed to the channel
  RunTime received{};  ///< its last byte at the edge
  RunTime accepted{};  ///< parsed and admitted
  RunTime mapped{};    ///< local mapping done
  RunTime due{};       ///< preparation of the update started
};
/// In the order in which every codec writes them.
inline constexpr std::array kUpdateTimes = {&UpdateTimes::captured, &UpdateTimes::queued,
                                            &UpdateTimes::received, &UpdateTimes::accepted,
                                            &UpdateTimes::mapped,   &UpdateTimes::due};

/// MAP_UPDATE and RELOC_MAP, edge -> mobile: the new local map.
struct MapUpdate {
  std::uint64_t update = 0;  ///< counts from 1
  KeyFrameId newest;
  /// Points first observed by this keyframe or an earlier one are past the recent-point culling.
  /// Absent until enough keyframes are mapped.
  KeyFrameId newest_past_probation{};
  UpdateTimes times;
  MapDelta map;                     ///< keyframes with all their points
  std::vector<KeyFramePose> poses;  ///< other keyframes that moved since the last update
};

/// FRAME, mobile -> edge: a frame that a lost mobile wants to be relocalized (Edge-SLAM).
struct FrameMessage {
  static constexpr MessageType kType = kOffloadMessages["FRAME"];
  std::uint64_t frame_index = 0;
  double timestamp_s = 0;
  std::shared_ptr<const FeatureSet> features;
};

/// ACK: the message with this sequence on the same channel arrived.
struct AckMessage {
  static constexpr MessageType kType = kOffloadMessages["ACK"];
  std::uint64_t sequence = 0;
};

/// ANNOUNCE: sent and acknowledged before the message itself (stop and wait). It carries the
/// sequence and time that the transport below would replace with its own.
struct AnnounceMessage {
  static constexpr MessageType kType = kOffloadMessages["ANNOUNCE"];
  std::uint64_t sequence = 0;
  RunTime queued{};  ///< when the message was queued
  std::uint64_t bytes = 0;
};

/// BYE on the control channel. The mobile names the last KEYFRAME it sent, so that the edge can
/// wait for those in flight; the edge answers with its final counts.
struct ByeMessage {
  static constexpr MessageType kType = kOffloadMessages["BYE"];
  std::uint64_t last_keyframe_sequence = 0;
  std::uint64_t keyframes = 0, points = 0;  ///< in the global map
};

/// Throws Error unless the message contains one keyframe, or at most two if it starts a map: a
/// monocular map starts with two, and the message has the id of the later one.
void require_keyframes(const KeyFrameMessage& message);
/// Throws DecodeError for another number of keyframes, or if the last one has another id.
void expect_keyframes(const KeyFrameMessage& message);
Bytes encode(const KeyFrameMessage& message);
Bytes encode(const MapUpdate& message);
Bytes encode(const FrameMessage& message);
Bytes encode(const AckMessage& message);
Bytes encode(const AnnounceMessage& message);
Bytes encode(const ByeMessage& message);
Bytes encode_poses(const std::vector<KeyFramePose>& poses);

/// These throw only DecodeError.
KeyFrameMessage decode_keyframe(std::span<const std::uint8_t> bytes, const SensorPtr& sensor);
MapUpdate decode_update(std::span<const std::uint8_t> bytes, const SensorPtr& sensor);
FrameMessage decode_frame(std::span<const std::uint8_t> bytes, const SensorPtr& sensor);
AckMessage decode_ack(std::span<const std::uint8_t> bytes);
AnnounceMessage decode_announce(std::span<const std::uint8_t> bytes);
ByeMessage decode_bye(std::span<const std::uint8_t> bytes);
std::vector<KeyFramePose> decode_poses(std::span<const std::uint8_t> bytes);

}  // namespace slambed::wire
