// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "map/map_delta.hpp"
#include "wire/id_codec.hpp"

namespace slambed::wire {

/// Whether a writer leaves fresh points to the receiver.
enum class FreshPoints { kWhole, kDerived };

/// Writes and reads new points beside the keyframes of the same delta: whatever follows from those
/// (descriptor, reference keyframe, nearest distance) is named in a few bytes instead of repeated.
/// A fresh point, as tracking makes it of one feature with depth, follows whole from that feature:
/// its id is enough, where it may be off by what quantizing moved the feature.
class PointCodec {
 public:
  explicit PointCodec(const std::vector<NewKeyFrame>& keyframes,
                      FreshPoints fresh = FreshPoints::kWhole);
  void put(ByteWriter& out, IdStream& ids, const NewPoint& point);
  NewPoint get(ByteReader& in, IdStream& ids);
  /// Number of points that follow; throws DecodeError for more than can be there.
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
  /// The point that the receiver makes of the first feature that sees it; none without depth.
  std::optional<Fresh> fresh(MapPointId id);
  /// Whether the point can be sent as its id alone.
  bool is_fresh(const NewPoint& point);
  float nearest_from(float max_distance_m) const;
  const std::vector<PointObservation>& observations();

  const std::vector<NewKeyFrame>& keyframes_;
  FreshPoints fresh_;
  std::vector<PointObservation> observations_;  ///< sorted; filled when first needed
};

}  // namespace slambed::wire
