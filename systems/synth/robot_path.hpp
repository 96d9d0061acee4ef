// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "synth/camera_path.hpp"

namespace slambed::synth {

/// The camera of a wheeled robot in the hall (hall.hpp). It has a fixed height and pitch, looks
/// ahead, stops, and turns in place. Tracking on the named paths:
///   pioneer2    lost for more than half of the time, like TUM's fr2/pioneer_slam2
///   pioneer3    lost rarely and briefly
///   pioneer360  the robot turns in place nearly all the time
std::vector<std::string> robot_path_names();
bool is_robot_path(const std::string& name);
std::unique_ptr<CameraPath> make_robot_path(const std::string& name, std::uint64_t seed);

}  // namespace slambed::synth
