// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "geometry/camera.hpp"

namespace slambed::testing {

/// Returns a 640 x 480 camera without distortion.
inline Camera test_camera() {
  Camera camera;
  camera.width = 640, camera.height = 480;
  camera.fx = camera.fy = 525, camera.cx = 320, camera.cy = 240;
  return camera;
}

}  // namespace slambed::testing
