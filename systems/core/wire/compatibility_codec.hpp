// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "features/vocabulary.hpp"
#include "wire/direct_text.hpp"
#include "wire/messages.hpp"

namespace slambed::wire {

/// Encodes KEYFRAME, MAP_UPDATE and FRAME in the layout of Edge-SLAM's text archives. Every number
/// is decimal. A keyframe contains its key points twice, search grid, bag of words, scale tables,
/// pose in four forms, and all observed points by value. It takes 500 to 650 KB, and writing and
/// reading it through streams costs what it costs Edge-SLAM. The content is that of messages.hpp,
/// without quantization.
///
/// The bag of words and the grid, which Edge-SLAM computes on the mobile, are computed when a
/// message is written. The reader drops what it does not need. Two parts are only there to match
/// the size: the raw key points (a copy of the undistorted ones), and their size, response and
/// class.
///
/// known: existing points that the keyframe observes. They are written by value; observed points in
/// neither `known` nor the delta are written as ids.
Bytes encode_text(const KeyFrameMessage& message, std::span<const NewPoint> known,
                  const Vocabulary& vocabulary, DirectText* direct = nullptr);
Bytes encode_text(const MapUpdate& message, const Vocabulary& vocabulary,
                  DirectText* direct = nullptr);
Bytes encode_text(const FrameMessage& message, const Vocabulary& vocabulary,
                  DirectText* direct = nullptr);

/// These throw only DecodeError.
KeyFrameMessage decode_keyframe_text(std::span<const std::uint8_t> bytes, const SensorPtr& sensor,
                                     DirectText* direct = nullptr);
MapUpdate decode_update_text(std::span<const std::uint8_t> bytes, const SensorPtr& sensor,
                             DirectText* direct = nullptr);
FrameMessage decode_frame_text(std::span<const std::uint8_t> bytes, const SensorPtr& sensor,
                               DirectText* direct = nullptr);

}  // namespace slambed::wire
