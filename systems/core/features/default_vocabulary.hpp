// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "features/vocabulary.hpp"

namespace slambed {

/// The vocabulary that is built into every program (features/data/orb_10k.slv, trained on generated
/// rooms; docs/slam.md says how). Each call reads it again, a few milliseconds: share the result.
std::shared_ptr<const Vocabulary> default_vocabulary();

}  // namespace slambed
