// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "features/instances.hpp"
#include "wire/message_type.hpp"
#include "wire/messages.hpp"

namespace slambed::edgeslam_semantic {

using wire::Bytes, wire::SensorPtr;

inline constexpr wire::MessageRange kMessages(wire::kFirstOwnType,
                                              {"SEMANTIC_KEYFRAME", "OPT_RESULT", "MASK", "NO_MASK",
                                               "KEYFRAME_REFUSED"});

/// A map starts with two keyframes. After an edge restart the first upload has more, so that bundle
/// adjustment keeps the scale.
inline constexpr int kMostSemanticKeyFrames = 5;

/// SEMANTIC_KEYFRAME, mobile -> edge: a keyframe to map and its picture to segment.
struct SemanticKeyFrame {
  static constexpr wire::MessageType kType = kMessages["SEMANTIC_KEYFRAME"];
  /// Newest keyframe of the first upload of this map. The mobile ignores answers about another map.
  KeyFrameId map_id;
  RunTime captured{};               ///< when playback offered its frame
  std::uint64_t applied_slice = 0;  ///< newest slice applied before this upload, 0: none
  /// Newest edge-made point that the mobile knows. A restarted edge continues numbering after it.
  MapPointId newest_edge_point{};
  double n_m = 0.8;  ///< threshold of the segmentation's non-maximum suppression
  /// The keyframe with the ids of its points, the points that the edge does not know yet, and their
  /// observations in earlier keyframes. The first message of a map has all of its first keyframes
  /// and points.
  MapDelta delta;
  Bytes jpeg;  ///< empty: nothing is segmented

  KeyFrameId keyframe() const { return delta.keyframes.back().id; }
  bool first() const { return keyframe() == map_id; }
};

/// OPT_RESULT, edge -> mobile: the result of mapping a keyframe, as a slice with the changes since
/// the previous slice in the part of the map that the mobile keeps.
struct OptResult {
  static constexpr wire::MessageType kType = kMessages["OPT_RESULT"];
  KeyFrameId map_id;
  std::uint64_t number = 0;  ///< of the slice in this map, from 1
  KeyFrameId keyframe;
  SE3 T_cw;  ///< of the keyframe, optimized
  wire::UpdateTimes times;
  /// Positions of new and moved points, poses of keyframes, observations, and deletions. It has no
  /// complete keyframes because the mobile made them all.
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
  Duration took{};  ///< since the picture arrived
  FrameMasks masks;
};

/// Why a keyframe's picture has no mask.
enum class NoMaskReason : std::uint8_t {
  kNotSegmented = 0,  ///< the segmentation failed, or refused the picture
  kNotMapped = 1,     ///< the edge declined the keyframe and its picture
};

/// NO_MASK, edge -> mobile: replaces a MASK that will not come, so that the mobile stops waiting.
struct NoMaskMessage {
  static constexpr wire::MessageType kType = kMessages["NO_MASK"];
  KeyFrameId map_id;
  KeyFrameId keyframe;
  Duration took{};  ///< since the picture arrived
  NoMaskReason reason = NoMaskReason::kNotSegmented;
};

/// KEYFRAME_REFUSED, edge -> mobile: the edge could not decode an upload, so it will send neither a
/// slice nor a mask for it.
struct KeyFrameRefused {
  static constexpr wire::MessageType kType = kMessages["KEYFRAME_REFUSED"];
  std::uint64_t sequence = 0;  ///< of the SEMANTIC_KEYFRAME
};

Bytes encode(const SemanticKeyFrame& message);
Bytes encode(const OptResult& message);
Bytes encode(const MaskMessage& message);
Bytes encode(const NoMaskMessage& message);
Bytes encode(const KeyFrameRefused& message);

/// All decoders throw wire::DecodeError and nothing else.
SemanticKeyFrame decode_semantic_keyframe(std::span<const std::uint8_t> bytes,
                                          const SensorPtr& sensor);
OptResult decode_opt_result(std::span<const std::uint8_t> bytes);
MaskMessage decode_mask(std::span<const std::uint8_t> bytes, const SensorPtr& sensor);
NoMaskMessage decode_no_mask(std::span<const std::uint8_t> bytes);
KeyFrameRefused decode_keyframe_refused(std::span<const std::uint8_t> bytes);

}  // namespace slambed::edgeslam_semantic
