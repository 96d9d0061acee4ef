// SPDX-License-Identifier: Apache-2.0
#include "edgeslam_semantic/tests/message_examples.hpp"

namespace slambed::wire {

std::vector<Target> fuzzed_targets() { return edgeslam_semantic::targets(); }

}  // namespace slambed::wire
