// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "node/policy.hpp"

namespace slambed {

/// Multithread, Relocate and Multithread-RL: conventional Edge-SLAM in which updates may be
/// prepared in parallel to tracking, and the edge may relocalize lost frames. The variants of
/// system.yaml differ in parameters only.
System multithread_rl_system();

}  // namespace slambed
