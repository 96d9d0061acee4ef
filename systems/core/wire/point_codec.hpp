// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "map/map_delta.hpp"
#include "wire/id_codec.hpp"

namespace slambed::wire {

/// Whether fresh points are written whole, or as ids from which the receiver derives them.
enum class FreshPoints { kWhole, kDerived };

/// Writes and reads new points with the help of the keyframes of the same delta. Descriptor,
/// reference keyframe and minimum distance become short references to them. A fresh point, which
/// tracking made from one feature with depth, is written as its id alone. The receiver recomputes
/// it from the quantized feature, so its position has the error of the quantization.
class PointCodec {
 public:
  explicit PointCodec(const std::vector<NewKeyFrame>& keyframes,
                      FreshPoints fresh = FreshPoints::kWhole);
  void put(ByteWriter& out, IdStream& ids, const NewPoint& point);
  NewPoint get(ByteReader& in, IdStream& ids);
  /// Returns the number of points that follow. Throws DecodeError if the message cannot hold them.
  std::size_t get_count(ByteReader& in);

 private:
  struct PointObservation {
    std::uint64_t point = 0;
    std::uint32_t keyframe = 0;  ///< index in the delta
    std::uint32_t feature = 0;
    auto operator<=>(const PointObservation&) const = default;
  };
  const PointObservation* find_descriptor(const NewPoint& point);
  struct Fresh {
    NewPoint point;
    double distance_m = 0;  ///< from the camera
  };
  /// Returns the point that the receiver makes from the first feature that observes it, or nothing
  /// if that feature has no depth.
  std::optional<Fresh> fresh(MapPointId id);
  /// Whether the point can be sent as its id alone.
  bool is_fresh(const NewPoint& point);
  float nearest_from(float max_distance_m) const;
  const std::vector<PointObservation>& observations();

  const std::vector<NewKeyFrame>& keyframes_;
  FreshPoints fresh_;
  std::vector<PointObservation> observations_;  ///< sorted; filled on first use
};

}  // namespace slambed::wire
