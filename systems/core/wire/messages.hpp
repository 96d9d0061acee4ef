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

/// What every system with an edge sends.
inline constexpr MessageRange kOffloadMessages(1, {"KEYFRAME", "MAP_UPDATE", "FRAME", "RELOC_MAP",
                                                   "ACK", "PROBE", "BYE", "POSES", "ANNOUNCE",
                                                   "KEYFRAME_WANTED"});
inline constexpr MessageType kKeyFrame = kOffloadMessages["KEYFRAME"];
inline constexpr MessageType kMapUpdate = kOffloadMessages["MAP_UPDATE"];
/// edge -> mobile: MAP_UPDATE with the candidates.
inline constexpr MessageType kRelocMap = kOffloadMessages["RELOC_MAP"];
/// Keeps RTT samples coming; content is ignored.
inline constexpr MessageType kProbe = kOffloadMessages["PROBE"];
/// edge -> mobile: where all keyframes ended up.
inline constexpr MessageType kPoses = kOffloadMessages["POSES"];
/// edge -> mobile: there is no map yet that a keyframe could join.
inline constexpr MessageType kKeyFrameWanted = kOffloadMessages["KEYFRAME_WANTED"];

using SensorPtr = std::shared_ptr<const Sensor>;

/// KEYFRAME, mobile -> edge.
struct KeyFrameMessage {
  KeyFrameId keyframe;
  RunTime captured{};                 ///< when playback offered its frame
  bool urgent = false;                ///< Edge-SLAM's flag 2: c1c holds, the edge need not agree
  bool first = false;                 ///< a map begins with it, or the trip in a stored one
  bool whole = false;                 ///< holds all points it sees: a map can start with it
  bool after_relocalization = false;  ///< within a second of one: Edge-SLAM's passedF is false
  std::uint64_t applied_update = 0;   ///< newest update the mobile had applied, 0: none
  /// Newest point of an edge mapper that the mobile ever saw: a restarted edge counts on behind it.
  MapPointId newest_edge_point{};
  MapDelta delta;
};

/// When the keyframe that closes an update passed each place; run clock.
struct UpdateTimes {
  RunTime captured{};  ///< frame offered on the mobile
  RunTime queued{};    ///< KEYFRAME handed to the channel
  RunTime received{};  ///< its last byte at the edge
  RunTime accepted{};  ///< parsed and admitted
  RunTime mapped{};    ///< local mapping done
  RunTime due{};       ///< preparation of the update began
};
/// In the order in which every codec writes them.
inline constexpr std::array kUpdateTimes = {&UpdateTimes::captured, &UpdateTimes::queued,
                                            &UpdateTimes::received, &UpdateTimes::accepted,
                                            &UpdateTimes::mapped,   &UpdateTimes::due};

/// MAP_UPDATE and RELOC_MAP, edge -> mobile: becomes the local map.
struct MapUpdate {
  std::uint64_t update = 0;  ///< counts from 1
  KeyFrameId newest;
  /// Points first seen by this keyframe or an earlier one will not be culled for how rarely they
  /// are found; none: too few keyframes were mapped.
  KeyFrameId newest_past_probation{};
  UpdateTimes times;
  MapDelta map;                     ///< the keyframes with all their points
  std::vector<KeyFramePose> poses;  ///< of other keyframes that moved since the last update
};

/// FRAME, mobile -> edge: the question of a lost mobile (Edge-SLAM), where it is; not FRAME_IMAGE.
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

/// ANNOUNCE: goes ahead of a message that waits to be acknowledged, and says what of it the
/// transport below would get wrong.
struct AnnounceMessage {
  static constexpr MessageType kType = kOffloadMessages["ANNOUNCE"];
  std::uint64_t sequence = 0;
  RunTime queued{};  ///< when it began to wait
  std::uint64_t bytes = 0;
};

/// BYE on the control channel. The mobile names the last KEYFRAME it sent, so that the edge can
/// take in what is still under way; the edge answers with its final counts.
struct ByeMessage {
  static constexpr MessageType kType = kOffloadMessages["BYE"];
  std::uint64_t last_keyframe_sequence = 0;
  std::uint64_t keyframes = 0, points = 0;  ///< of the global map
};

/// A KEYFRAME holds one keyframe, whatever its form; one that a map starts with may hold two, as a
/// single camera's map begins with them, and is named by the later. Throws Error for other numbers.
void require_keyframes(const KeyFrameMessage& message);
/// Throws DecodeError for other numbers and other names.
void expect_keyframes(const KeyFrameMessage& message);
Bytes encode(const KeyFrameMessage& message);
Bytes encode(const MapUpdate& message);
Bytes encode(const FrameMessage& message);
Bytes encode(const AckMessage& message);
Bytes encode(const AnnounceMessage& message);
Bytes encode(const ByeMessage& message);
Bytes encode_poses(const std::vector<KeyFramePose>& poses);

/// All throw DecodeError and nothing else.
KeyFrameMessage decode_keyframe(std::span<const std::uint8_t> bytes, const SensorPtr& sensor);
MapUpdate decode_update(std::span<const std::uint8_t> bytes, const SensorPtr& sensor);
FrameMessage decode_frame(std::span<const std::uint8_t> bytes, const SensorPtr& sensor);
AckMessage decode_ack(std::span<const std::uint8_t> bytes);
AnnounceMessage decode_announce(std::span<const std::uint8_t> bytes);
ByeMessage decode_bye(std::span<const std::uint8_t> bytes);
std::vector<KeyFramePose> decode_poses(std::span<const std::uint8_t> bytes);

}  // namespace slambed::wire
