// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "base/ids.hpp"
#include "features/instances.hpp"
#include "geometry/se3.hpp"
#include "wire/byte_io.hpp"
#include "wire/message_type.hpp"

namespace slambed::wire {

/// Pictures that are tracked on the edge.
inline constexpr MessageRange kFrameMessages(64, {"FRAME_IMAGE", "FRAME_RESULT"});

/// A picture that the edge is to track.
struct FrameImage {
  static constexpr MessageType kType = kFrameMessages["FRAME_IMAGE"];
  std::uint64_t frame_index = 0;  ///< in the sequence
  double timestamp_s = 0;         ///< sequence time
  RunTime captured{};             ///< offered by the camera
  RunTime dequeued{};             ///< taken up by the mobile node
  Bytes jpeg;
};

Bytes encode(const FrameImage& message);
FrameImage decode_frame_image(std::span<const std::uint8_t> bytes);

/// The times of a frame's way, on the run's clock.
struct FrameTimes {
  RunTime captured{}, dequeued{};  ///< as its FRAME_IMAGE said
  RunTime queued{};                ///< handed to the channel
  RunTime received{};              ///< its last byte at the edge
  RunTime begun{};                 ///< taken up there
  /// What the parts took: segmentation; decoding and extraction, beside it; tracking; mapping;
  /// loops.
  Duration nrcc{}, extract{}, track{}, local_mapping{}, loop_closing{};
  RunTime done{};  ///< the answer handed to the channel
};

enum class FrameState : std::uint8_t { kNotInitialized, kOk, kLost };

/// What became of it.
struct FrameResult {
  static constexpr MessageType kType = kFrameMessages["FRAME_RESULT"];
  std::uint64_t sequence = 0;  ///< of the FRAME_IMAGE that it answers
  std::uint64_t frame_index = 0;
  FrameState state = FrameState::kNotInitialized;
  bool reset = false;  ///< the map was thrown away
  SE3 T_cw;            ///< with kOk
  KeyFrameId reference;
  SE3 T_cr;
  std::uint32_t features = 0, inliers = 0;
  FrameTimes times;
  FrameMasks masks;
};

Bytes encode(const FrameResult& message);
/// sensor: whose pictures the masks are of. Both throw DecodeError.
FrameResult decode_frame_result(std::span<const std::uint8_t> bytes,
                                const std::shared_ptr<const Sensor>& sensor);

}  // namespace slambed::wire
