// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "features/instances.hpp"
#include "wire/byte_io.hpp"

namespace slambed::wire {

/// Masks to the pixel, key points to an eighth of one. Runs are written as differences to the run
/// two before: a row of a mask looks like the row above and costs two bytes.
void put_masks(ByteWriter& out, const FrameMasks& masks);
/// Throws DecodeError, also for masks of a picture of another size.
FrameMasks get_masks(ByteReader& in, int width, int height);

Bytes encode_masks(const FrameMasks& masks);
FrameMasks decode_masks(std::span<const std::uint8_t> bytes, int width, int height);

/// What a segmentation writes, in mask caches and as its answers (docs/reference/sequence.md):
/// plain numbers, easy to write from any language. Throws DecodeError as decode_masks does.
FrameMasks decode_segmentation(std::uint32_t instances, std::span<const std::uint8_t> bytes,
                               int width, int height);
Bytes encode_segmentation(const FrameMasks& masks);

}  // namespace slambed::wire
