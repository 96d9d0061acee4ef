// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "features/vocabulary.hpp"

namespace slambed {

/// Returns the vocabulary that is built into every program (features/data/orb_10k.slv, trained on
/// synthetic rooms by tools/train_vocabulary.sh). Each call parses it again, which takes a few
/// milliseconds, so callers should share it.
std::shared_ptr<const Vocabulary> default_vocabulary();

}  // namespace slambed
