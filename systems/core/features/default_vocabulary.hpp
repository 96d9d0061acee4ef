// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "features/vocabulary.hpp"

namespace slambed {

/// The vocabulary that is built into every program (features/data/orb_10k.slv, trained on generated
/// rooms by tools/train_vocabulary.sh). Each call reads it again, a few milliseconds: share it.
std::shared_ptr<const Vocabulary> default_vocabulary();

}  // namespace slambed
