// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "features/instances.hpp"
#include "wire/byte_io.hpp"

namespace slambed::wire {

/// Writes masks exactly and key points to 1/8 px. Each run length is written as the difference to
/// the run two before it: a mask row resembles the row above and mostly costs two bytes.
void put_masks(ByteWriter& out, const FrameMasks& masks);
/// Throws DecodeError, also for masks of an image of another size.
FrameMasks get_masks(ByteReader& in, int width, int height);

Bytes encode_masks(const FrameMasks& masks);
FrameMasks decode_masks(std::span<const std::uint8_t> bytes, int width, int height);

/// Decodes what a segmenter writes to mask caches and sends as its answers
/// (docs/reference/sequence.md, "Mask cache"): plain numbers, easy to write from any language.
/// Throws DecodeError.
FrameMasks decode_segmentation(std::uint32_t instances, std::span<const std::uint8_t> bytes,
                               int width, int height);
Bytes encode_segmentation(const FrameMasks& masks);

}  // namespace slambed::wire
