// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "synth/camera_path.hpp"

namespace slambed::synth {

/// A wheeled robot's camera: fixed height and pitch, it looks where it drives to, stops, and turns
/// in place. It goes through the hall (hall.hpp):
///   pioneer2    is lost for more than half of its time, as TUM's fr2/pioneer_slam2 is
///   pioneer3    is lost seldom and not for long
///   pioneer360  turns in place nearly all the time
std::vector<std::string> robot_path_names();
bool is_robot_path(const std::string& name);
std::unique_ptr<CameraPath> make_robot_path(const std::string& name, std::uint64_t seed);

}  // namespace slambed::synth
