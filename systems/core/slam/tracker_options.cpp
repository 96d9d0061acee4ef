// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "slam/tracker.hpp"

namespace slambed {

TrackerOptions suited(TrackerOptions options, SensorKind sensor) {
  switch (sensor) {
    case SensorKind::kRgbd:
      break;
    case SensorKind::kStereo:
      options.motion_window_px = 7;
      options.local_window_factor = 1;
      break;
    case SensorKind::kMono:
      options.min_init_features = std::min(options.min_init_features, 100);
      options.local_window_factor = 1;
      // Only triangulated points can be tracked, so keyframes are frequent, but never queued.
      options.reference_ratio = 0.9f;
      options.urgent_ratio = 0;
      options.busy_queue = 0;
      break;
  }
  return options;
}

}  // namespace slambed
