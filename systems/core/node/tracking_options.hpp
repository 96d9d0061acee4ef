// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "features/orb_extractor.hpp"
#include "node/parameters.hpp"
#include "slam/tracker.hpp"

namespace slambed {

/// Options of all systems from the parameter `n_orb`.
OrbOptions orb_options(const Parameters& parameters);
/// Options of all systems from `n_orb` and `second_hypotheses`; the others stay as they are.
TrackerOptions tracker_options(const Parameters& parameters, TrackerOptions options = {});

}  // namespace slambed
