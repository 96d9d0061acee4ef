// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "map/map_delta.hpp"
#include "wire/id_codec.hpp"

namespace slambed::wire {

/// Writes and reads new points beside the keyframes of the same delta: whatever follows from those
/// (descriptor, reference keyframe, nearest distance) is named in a few bytes instead of repeated.
class PointCodec {
 public:
  explicit PointCodec(const std::vector<NewKeyFrame>& keyframes);
  void put(ByteWriter& out, IdStream& ids, const NewPoint& point);
  NewPoint get(ByteReader& in, IdStream& ids) const;

  /// The least a point can take: flags, id, position, normal, distance, two counters, version.
  static constexpr std::size_t kMinBytes = 2 + 12 + 6 + 4 + 3;

 private:
  struct Sighting {
    std::uint64_t point = 0;
    std::uint32_t keyframe = 0;  ///< index in the delta
    std::uint32_t feature = 0;
    auto operator<=>(const Sighting&) const = default;
  };
  const Sighting* find_descriptor(const NewPoint& point);
  float nearest_from(float max_distance_m) const;
  const std::vector<Sighting>& sightings();

  const std::vector<NewKeyFrame>& keyframes_;
  std::vector<Sighting> sightings_;  ///< sorted; filled when first needed
};

}  // namespace slambed::wire
