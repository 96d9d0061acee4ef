// SPDX-License-Identifier: Apache-2.0
#include "wire/tests/decoders.hpp"

namespace slambed::wire {

std::vector<Target> fuzzed_targets() { return targets(); }

}  // namespace slambed::wire
