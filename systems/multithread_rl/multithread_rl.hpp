// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "node/policy.hpp"

namespace slambed {

/// Multithread, Relocate and Multithread-RL: conventional Edge-SLAM whose updates may be put
/// together beside tracking, and whose lost frames may be found by the edge. The variants of
/// system.yaml differ in parameters only.
System multithread_rl_system();

}  // namespace slambed
