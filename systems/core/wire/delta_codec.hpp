// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "map/map_delta.hpp"
#include "wire/byte_io.hpp"
#include "wire/point_codec.hpp"

namespace slambed::wire {

/// A MapDelta as a whole, lists in the order: keyframes, points, attach, detach, fusions,
/// positions, poses, observations, culled points, culled keyframes. Lost: features as said in
/// feature_codec.hpp, positions to 32-bit floats, normals to 1.6e-5. A point's descriptor is named
/// rather than repeated when a keyframe of the same delta shows it.
void put_delta(ByteWriter& out, const MapDelta& delta, FreshPoints fresh = FreshPoints::kWhole);
/// Throws DecodeError. The sensor is needed only when keyframes are inside.
MapDelta get_delta(ByteReader& in, const std::shared_ptr<const Sensor>& sensor);

Bytes encode(const MapDelta& delta, FreshPoints fresh = FreshPoints::kWhole);
MapDelta decode_delta(std::span<const std::uint8_t> bytes,
                      const std::shared_ptr<const Sensor>& sensor);

/// Rotation as quaternion, 56 bytes.
void put_pose(ByteWriter& out, const SE3& pose);
SE3 get_pose(ByteReader& in);
void put_poses(ByteWriter& out, const std::vector<KeyFramePose>& poses);
std::vector<KeyFramePose> get_poses(ByteReader& in);

}  // namespace slambed::wire
