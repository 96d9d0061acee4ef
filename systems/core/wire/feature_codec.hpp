// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "features/feature_set.hpp"
#include "wire/byte_io.hpp"

namespace slambed::wire {

/// 40 bytes per feature: u, v, depth, octave and angle in 16 bits each, descriptor in 32 bytes.
/// What is lost: u and v at most (width + 64 px) / 131070 (0.0054 px at 640 px), depth at most
/// 1.23e-4 of itself (0.4 mm at 3 m; right_u is computed again from it), angle 0.044 degrees; a
/// depth outside [0.0625, 4096) m is none.
void put_features(ByteWriter& out, const FeatureSet& features);
/// Throws DecodeError.
std::shared_ptr<const FeatureSet> get_features(ByteReader& in,
                                               std::shared_ptr<const Sensor> sensor);

/// The feature as the receiver gets it; a received one stays as it is.
KeyPoint as_received(const KeyPoint& point, const Sensor& sensor);

inline constexpr std::size_t kFeatureBytes = 40;
/// Feature numbers are 16 bits wide.
inline constexpr std::size_t kMaxFeatures = 65'000;

/// Depth in 4 bits of exponent and 12 of mantissa, rounded; 0 is none.
std::uint16_t quantize_depth(float depth_m);
float restore_depth(std::uint16_t code);

}  // namespace slambed::wire
