// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "map/map_delta.hpp"
#include "wire/byte_io.hpp"
#include "wire/point_codec.hpp"

namespace slambed::wire {

/// Writes a whole MapDelta with its lists in this order: keyframes, points, attach, detach,
/// fusions, positions, poses, observation counts, culled points, culled keyframes. Features are
/// quantized as in feature_codec.hpp, positions to 32-bit floats, normals to 1.6e-5. A point's
/// descriptor is written as a reference if a keyframe of the same delta contains it.
void put_delta(ByteWriter& out, const MapDelta& delta, FreshPoints fresh = FreshPoints::kWhole);
/// Throws DecodeError. The sensor may be null if the delta contains no keyframes.
MapDelta get_delta(ByteReader& in, const std::shared_ptr<const Sensor>& sensor);

Bytes encode(const MapDelta& delta, FreshPoints fresh = FreshPoints::kWhole);
MapDelta decode_delta(std::span<const std::uint8_t> bytes,
                      const std::shared_ptr<const Sensor>& sensor);

/// Writes a quaternion (w, x, y, z) and a translation as doubles, 56 bytes.
void put_pose(ByteWriter& out, const SE3& pose);
SE3 get_pose(ByteReader& in);
void put_poses(ByteWriter& out, const std::vector<KeyFramePose>& poses);
std::vector<KeyFramePose> get_poses(ByteReader& in);

}  // namespace slambed::wire
