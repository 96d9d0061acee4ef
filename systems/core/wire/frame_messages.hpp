// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "base/ids.hpp"
#include "features/instances.hpp"
#include "geometry/se3.hpp"
#include "wire/byte_io.hpp"
#include "wire/message_type.hpp"

namespace slambed::wire {

/// Messages for tracking on the edge.
inline constexpr MessageRange kFrameMessages(64, {"FRAME_IMAGE", "FRAME_RESULT"});

/// FRAME_IMAGE, mobile -> edge: an image for the edge to track.
struct FrameImage {
  static constexpr MessageType kType = kFrameMessages["FRAME_IMAGE"];
  std::uint64_t frame_index = 0;  ///< in the sequence
  double timestamp_s = 0;         ///< sequence time
  RunTime captured{};             ///< when the camera offered it
  RunTime dequeued{};             ///< when the mobile took it from its queue
  Bytes jpeg;
};

Bytes encode(const FrameImage& message);
FrameImage decode_frame_image(std::span<const std::uint8_t> bytes);

/// When a frame passed each step, on the run clock.
struct FrameTimes {
  RunTime captured{}, dequeued{};  ///< copied from its FRAME_IMAGE
  RunTime queued{};                ///< FRAME_IMAGE handed to the channel
  RunTime received{};              ///< its last byte at the edge
  RunTime begun{};                 ///< when the edge took it from its queue
  /// How long each part took: segmentation, decoding and extraction (in parallel with it),
  /// tracking, local mapping, loop closing.
  Duration nrcc{}, extract{}, track{}, local_mapping{}, loop_closing{};
  RunTime done{};  ///< FRAME_RESULT handed to the channel
};

enum class FrameState : std::uint8_t { kNotInitialized, kOk, kLost };

/// FRAME_RESULT, edge -> mobile: how tracking a FRAME_IMAGE ended.
struct FrameResult {
  static constexpr MessageType kType = kFrameMessages["FRAME_RESULT"];
  std::uint64_t sequence = 0;  ///< of the FRAME_IMAGE that it answers
  std::uint64_t frame_index = 0;
  FrameState state = FrameState::kNotInitialized;
  bool reset = false;  ///< the edge discarded its map
  SE3 T_cw;            ///< this and the next two only with kOk
  KeyFrameId reference;
  SE3 T_cr;
  std::uint32_t features = 0, inliers = 0;
  FrameTimes times;
  FrameMasks masks;
};

Bytes encode(const FrameResult& message);
/// sensor: the camera whose images the masks belong to. Both decoders throw DecodeError.
FrameResult decode_frame_result(std::span<const std::uint8_t> bytes,
                                const std::shared_ptr<const Sensor>& sensor);

}  // namespace slambed::wire
