// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "features/feature_set.hpp"
#include "wire/byte_io.hpp"

namespace slambed::wire {

/// Writes 40 bytes per feature: u, v, depth and octave with angle in 16 bits each, the descriptor
/// in 32 bytes. The largest errors are (width + 64 px) / 131070 in u and v (0.0054 px at 640 px),
/// 1.23e-4 of the depth (0.4 mm at 3 m), and 0.044 degrees. right_u is recomputed from the depth. A
/// depth outside [0.0625, 4096) m becomes "no depth".
void put_features(ByteWriter& out, const FeatureSet& features);
/// Throws DecodeError.
std::shared_ptr<const FeatureSet> get_features(ByteReader& in,
                                               std::shared_ptr<const Sensor> sensor);

/// Returns the key point as the receiver will decode it. Applying this twice changes nothing more.
KeyPoint as_received(const KeyPoint& point, const Sensor& sensor);

inline constexpr std::size_t kFeatureBytes = 40;
/// Feature indices are 16 bits wide.
inline constexpr std::size_t kMaxFeatures = 65'000;

/// Rounds a depth to 4 bits of exponent and 12 of mantissa. Code 0 is "no depth".
std::uint16_t quantize_depth(float depth_m);
float restore_depth(std::uint16_t code);

}  // namespace slambed::wire
