// SPDX-License-Identifier: Apache-2.0
#include "programs/systems.hpp"

#include "cloudslam/cloudslam.hpp"
#include "dynnetslam/dynnetslam.hpp"
#include "edgeslam/edgeslam.hpp"
#include "multithread_rl/multithread_rl.hpp"
#include "orbslam2/orbslam2.hpp"

namespace slambed {

std::vector<System> all_systems() {
  return {orbslam2_system(), edgeslam_system(), dynnetslam_system(), multithread_rl_system(),
          cloudslam_system()};
}

}  // namespace slambed
