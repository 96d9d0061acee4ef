// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "features/image.hpp"
#include "wire/byte_io.hpp"

namespace slambed::wire {

struct GrayImage {
  int width = 0, height = 0;
  std::vector<std::uint8_t> pixels;
  GrayView view() const { return {pixels.data(), width, height, width}; }
};

/// Returns a gray JPEG. quality: 1 to 100. Equal images give equal bytes on every processor: the
/// SIMD kernels of libjpeg-turbo reproduce its accurate DCT bit for bit.
Bytes encode_jpeg(GrayView image, int quality);

/// Throws DecodeError unless the data have the header of a gray JPEG of that size and its end
/// marker. Does not look at the data in between.
void check_jpeg(std::span<const std::uint8_t> jpeg, int width, int height);

/// Calls check_jpeg before it allocates pixels. Throws DecodeError also for truncated or damaged
/// data, so a returned image is complete.
GrayImage decode_jpeg(std::span<const std::uint8_t> jpeg, int width, int height);

}  // namespace slambed::wire
