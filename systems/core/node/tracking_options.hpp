// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "features/orb_extractor.hpp"
#include "node/parameters.hpp"
#include "slam/tracker.hpp"

namespace slambed {

/// What every system's tracking takes alike from its parameters: `n_orb` ...
OrbOptions orb_options(const Parameters& parameters);
/// ... and `n_orb` and `second_hypotheses`. The other options stay as they are.
TrackerOptions tracker_options(const Parameters& parameters, TrackerOptions options = {});

}  // namespace slambed
