// SPDX-License-Identifier: Apache-2.0
#include "store/archive.hpp"

#include <unordered_map>
#include <vector>

#include "map/map_snapshot.hpp"

namespace slambed {
namespace {

/// New ids for old ones, in ascending order of the old ones.
template <typename IdType>
class Renumbering {
 public:
  Renumbering(const std::vector<IdType>& ids, IdSpace space) {
    IdSource<IdType> source(space);
    for (const IdType id : ids) renamed_.emplace(id, source.next());
  }
  /// None for an id that no longer exists.
  IdType operator()(IdType id) const {
    const auto found = renamed_.find(id);
    return found == renamed_.end() ? IdType{} : found->second;
  }

 private:
  std::unordered_map<IdType, IdType> renamed_;
};

}  // namespace

std::shared_ptr<Map> archive(const Map& map, IdSpace keyframes) {
  struct Copy {
    MapDelta delta;
    std::vector<KeyFrameId> keyframes;
    std::vector<MapPointId> points;
  };
  Copy copy = map.read([](const MapView& view) {
    return Copy{snapshot(view), view.keyframe_ids(), view.point_ids()};
  });
  const Renumbering<KeyFrameId> keyframe(copy.keyframes, keyframes);
  const Renumbering<MapPointId> point(copy.points, IdSpace::kEdgeMapper);
  for (NewKeyFrame& k : copy.delta.keyframes) {
    k.id = keyframe(k.id);
    k.parent = keyframe(k.parent);
    for (MapPointId& id : k.points) id = point(id);
  }
  for (NewPoint& p : copy.delta.points) {
    p.id = point(p.id);
    p.reference = keyframe(p.reference);
    // The keyframe that first saw a point may be gone, and every point must name one.
    const KeyFrameId first = keyframe(p.first_keyframe);
    p.first_keyframe = first ? first : p.reference;
  }
  auto archived = std::make_shared<Map>();
  archived->commit(copy.delta);
  return archived;
}

}  // namespace slambed
