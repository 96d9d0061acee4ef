// SPDX-License-Identifier: Apache-2.0
#include "offload/downlink/map_downlink.hpp"

#include "offload/maps/map_sync.hpp"

namespace slambed {

MapDownlink::MapDownlink(MobileNode& node, Channel& channel, DownlinkOptions options)
    : node_(node),
      inbox_(node, channel, options.rules, std::move(options.codec)),
      exchange_(node, inbox_),
      path_(options.path(node, inbox_, exchange_)) {}

void MapDownlink::before_frame(Worker& worker) {
  inbox_.look();
  path_->before_frame(worker);
}

void MapDownlink::join(const MapDelta& keyframe, std::uint64_t update, std::uint64_t incarnation,
                       bool takes_its_place) {
  const auto map = node_.tracker().map();
  if (takes_its_place) map->clear();
  map->commit(map->read([&](const MapView& view) { return rebase_changes(view, keyframe); }));
  if (takes_its_place) node_.replace_map(map);  // what tracking knows of it is of another world
  for (const NewKeyFrame& made : keyframe.keyframes) node_.poses().placed(made.id, made.T_cw);
  inbox_.joined(keyframe, update, incarnation);
}

void MapDownlink::keyframe_created(RunTime when, const MapDelta& made, bool provisional) {
  inbox_.keyframe_created(when);
  for (const NewKeyFrame& keyframe : made.keyframes)
    path_->keyframe_created(keyframe.id, provisional);
}

}  // namespace slambed
