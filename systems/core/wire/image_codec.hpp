// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "features/image.hpp"
#include "wire/byte_io.hpp"

namespace slambed::wire {

/// A gray picture that was decoded.
struct GrayImage {
  int width = 0, height = 0;
  std::vector<std::uint8_t> pixels;
  GrayView view() const { return {pixels.data(), width, height, width}; }
};

/// A gray JPEG. quality: 1 to 100. Equal pictures give equal bytes, whatever the processor: the
/// transform is libjpeg-turbo's accurate one, which its vector kernels repeat bit for bit.
Bytes encode_jpeg(GrayView image, int quality);

/// Throws DecodeError unless this begins as a gray JPEG of that size and ends as one; looks at
/// nothing in between.
void check_jpeg(std::span<const std::uint8_t> jpeg, int width, int height);

/// Checks the header as check_jpeg does, before room is made for a pixel. Throws DecodeError for
/// what is torn or damaged, too: a picture is whole or none.
GrayImage decode_jpeg(std::span<const std::uint8_t> jpeg, int width, int height);

}  // namespace slambed::wire
