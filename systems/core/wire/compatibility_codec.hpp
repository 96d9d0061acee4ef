// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "features/vocabulary.hpp"
#include "wire/direct_text.hpp"
#include "wire/messages.hpp"

namespace slambed::wire {

/// KEYFRAME, MAP_UPDATE and FRAME as Edge-SLAM's text archives have them: every number in decimal,
/// key points twice, the search grid, the bag of words, the scale tables, each pose in four forms,
/// and each keyframe with all the points it sees by value. A keyframe takes 500 to 650 KB, and its
/// writing and reading, by streams, the time that those need for it. What the message stands for is
/// the same as in messages.hpp, without its quantization.
///
/// What Edge-SLAM derives on the mobile is derived when a message is written (bag of words, grid);
/// what the receiver does not need is read and dropped. Two things we have no equal of and write
/// for their size: the raw key points (the undistorted ones again) and their size, response and
/// class.
///
/// known: points by value that the keyframe sees besides its new ones; those that are missing are
/// named only.
Bytes encode_text(const KeyFrameMessage& message, std::span<const NewPoint> known,
                  const Vocabulary& vocabulary, DirectText* direct = nullptr);
Bytes encode_text(const MapUpdate& message, const Vocabulary& vocabulary,
                  DirectText* direct = nullptr);
Bytes encode_text(const FrameMessage& message, const Vocabulary& vocabulary,
                  DirectText* direct = nullptr);

/// All throw DecodeError and nothing else.
KeyFrameMessage decode_keyframe_text(std::span<const std::uint8_t> bytes, const SensorPtr& sensor,
                                     DirectText* direct = nullptr);
MapUpdate decode_update_text(std::span<const std::uint8_t> bytes, const SensorPtr& sensor,
                             DirectText* direct = nullptr);
FrameMessage decode_frame_text(std::span<const std::uint8_t> bytes, const SensorPtr& sensor,
                               DirectText* direct = nullptr);

}  // namespace slambed::wire
