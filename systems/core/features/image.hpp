// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

namespace slambed {

/// Non-owning view of an image plane; stride in elements.
template <typename Pixel>
struct ImageView {
  const Pixel* data = nullptr;
  int width = 0, height = 0;
  std::ptrdiff_t stride = 0;

  const Pixel* row(int y) const { return data + y * stride; }
  const Pixel& at(int x, int y) const { return row(y)[x]; }
};

using GrayView = ImageView<std::uint8_t>;
/// Raw depth: meters = value * depth unit of the sequence; 0 means no measurement.
using DepthView = ImageView<std::uint16_t>;

}  // namespace slambed
