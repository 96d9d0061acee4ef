// SPDX-License-Identifier: Apache-2.0
#include "node/tracking_options.hpp"

#include <algorithm>

namespace slambed {

OrbOptions orb_options(const Parameters& parameters) {
  OrbOptions options;
  options.features = parameters.integer("n_orb");
  return options;
}

TrackerOptions tracker_options(const Parameters& parameters, TrackerOptions options) {
  // ORB-SLAM2 needs 500 features to initialize; with a small n_orb no frame has that many.
  options.min_init_features = std::min(500, parameters.integer("n_orb") / 2);
  options.second_hypotheses = parameters.boolean("second_hypotheses");
  return options;
}

}  // namespace slambed
