// SPDX-License-Identifier: Apache-2.0
#include "offload/downlink/map_downlink.hpp"

#include "offload/maps/map_sync.hpp"

namespace slambed {

MapDownlink::MapDownlink(MobileNode& node, Channel& channel, DownlinkOptions options)
    : node_(node),
      receiver_(node, channel, std::move(options.codec)),
      check_(node, options.rules),
      applier_(options.applier(node, receiver_, check_)) {}

void MapDownlink::before_frame(Worker& worker) {
  check_.look();
  applier_->before_frame(worker);
}

void MapDownlink::join(const MapDelta& keyframe, std::uint64_t update, std::uint64_t session,
                       bool takes_its_place) {
  const auto map = node_.tracker().map();
  if (takes_its_place) map->clear();
  map->commit(map->read([&](const MapView& view) { return rebase_changes(view, keyframe); }));
  if (takes_its_place) node_.replace_map(map);  // tracking still refers to the cleared map
  for (const NewKeyFrame& made : keyframe.keyframes) node_.poses().placed(made.id, made.T_cw);
  check_.joined(keyframe, update, session);
}

void MapDownlink::keyframe_created(RunTime when, const MapDelta& made, bool provisional) {
  check_.keyframe_created(when);
  for (const NewKeyFrame& keyframe : made.keyframes)
    applier_->keyframe_created(keyframe.id, provisional);
}

}  // namespace slambed
