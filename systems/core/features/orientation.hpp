// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "features/kernels.hpp"

namespace slambed {

/// Direction from a keypoint to the intensity centroid of its disc (x right, y down).
struct Orientation {
  float cosine = 1, sine = 0;
  float angle_deg = 0;  ///< [0, 360)
};

/// Uses only correctly rounded operations, so every machine gets the same bits. Zero moments give
/// angle 0.
Orientation orientation_of(Moments moments);

}  // namespace slambed
