// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "map/map.hpp"

namespace slambed {

/// Points (gray, brighter the more keyframes see them) and keyframe centers (red) as an ASCII PLY
/// cloud, world frame, meters.
void export_ply(const Map& map, const std::filesystem::path& path);

/// Keyframes as a TUM trajectory: recorded time, camera to world, in time order.
void export_tum(const Map& map, double time_origin_s, const std::filesystem::path& path);

/// Keyframes in KITTI format: the 3x4 camera-to-world matrix row by row, one keyframe per line, in
/// time order.
void export_kitti(const Map& map, const std::filesystem::path& path);

}  // namespace slambed
