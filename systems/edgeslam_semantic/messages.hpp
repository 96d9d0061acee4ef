// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "features/instances.hpp"
#include "wire/message_type.hpp"
#include "wire/messages.hpp"

namespace slambed::edgeslam_semantic {

using wire::Bytes, wire::SensorPtr;

/// Keyframes whose pictures are segmented.
inline constexpr wire::MessageRange kMessages(wire::kFirstOwnType,
                                              {"SEMANTIC_KEYFRAME", "OPT_RESULT", "MASK", "NO_MASK",
                                               "KEYFRAME_REFUSED"});

/// A map begins with two; that of a restarted edge with some more, so that its bundle keeps the
/// scale.
inline constexpr int kMostSemanticKeyFrames = 5;

/// SEMANTIC_KEYFRAME, mobile -> edge: a keyframe to be mapped, and its picture to be segmented.
struct SemanticKeyFrame {
  static constexpr wire::MessageType kType = kMessages["SEMANTIC_KEYFRAME"];
  /// The newer of the two keyframes that its map began with: answers about another map are worth
  /// nothing.
  KeyFrameId map_id;
  RunTime captured{};               ///< when playback offered its frame
  std::uint64_t applied_slice = 0;  ///< number of the newest slice that the pose knows of, 0: none
  /// Newest point of an edge's making that the mobile knows: a restarted one numbers on behind it.
  MapPointId newest_edge_point{};
  double n_m = 0.8;  ///< threshold of the segmentation's non-maximum suppression
  /// The keyframe (the first message of a map: all that it begins with, with all their points),
  /// with the ids of points that the edge knows, points that it does not, and which earlier
  /// keyframes saw those.
  MapDelta delta;
  Bytes jpeg;  ///< empty: nothing is segmented

  KeyFrameId keyframe() const { return delta.keyframes.back().id; }
  bool first() const { return keyframe() == map_id; }
};

/// OPT_RESULT, edge -> mobile: what mapping a keyframe came to, as what has changed in the part of
/// the map that the mobile keeps since the slice before.
struct OptResult {
  static constexpr wire::MessageType kType = kMessages["OPT_RESULT"];
  KeyFrameId map_id;
  std::uint64_t number = 0;  ///< of slices in this map, from 1
  KeyFrameId keyframe;
  SE3 T_cw;  ///< of the keyframe, optimized
  wire::UpdateTimes times;
  /// Points by position (new ones and moved ones alike), keyframes by pose, observations, what the
  /// edge has deleted. No keyframe is in it whole: the mobile made them all.
  MapDelta changes;
  std::vector<KeyFrameId>
      left_keyframes;  ///< still in the global map, no longer in the mobile's part
  std::vector<MapPointId> left_points;
};

/// MASK, edge -> mobile: what moves in a keyframe's picture.
struct MaskMessage {
  static constexpr wire::MessageType kType = kMessages["MASK"];
  KeyFrameId map_id;
  KeyFrameId keyframe;
  Duration took{};  ///< from the picture's arrival
  FrameMasks masks;
};

/// Why a keyframe's picture has no mask.
enum class NoMaskReason : std::uint8_t {
  kNotSegmented = 0,  ///< the segmentation failed, or refused the picture
  kNotMapped = 1,     ///< the edge declined the keyframe, picture and all
};

/// NO_MASK, edge -> mobile: in place of a MASK that will not come, so that nobody waits for it.
struct NoMaskMessage {
  static constexpr wire::MessageType kType = kMessages["NO_MASK"];
  KeyFrameId map_id;
  KeyFrameId keyframe;
  Duration took{};  ///< from the picture's arrival
  NoMaskReason reason = NoMaskReason::kNotSegmented;
};

/// KEYFRAME_REFUSED, edge -> mobile: what came under this number could not be read, so no answer
/// will come of it.
struct KeyFrameRefused {
  static constexpr wire::MessageType kType = kMessages["KEYFRAME_REFUSED"];
  std::uint64_t sequence = 0;  ///< of the SEMANTIC_KEYFRAME
};

Bytes encode(const SemanticKeyFrame& message);
Bytes encode(const OptResult& message);
Bytes encode(const MaskMessage& message);
Bytes encode(const NoMaskMessage& message);
Bytes encode(const KeyFrameRefused& message);

/// All throw wire::DecodeError and nothing else.
SemanticKeyFrame decode_semantic_keyframe(std::span<const std::uint8_t> bytes,
                                          const SensorPtr& sensor);
OptResult decode_opt_result(std::span<const std::uint8_t> bytes);
MaskMessage decode_mask(std::span<const std::uint8_t> bytes, const SensorPtr& sensor);
NoMaskMessage decode_no_mask(std::span<const std::uint8_t> bytes);
KeyFrameRefused decode_keyframe_refused(std::span<const std::uint8_t> bytes);

}  // namespace slambed::edgeslam_semantic
