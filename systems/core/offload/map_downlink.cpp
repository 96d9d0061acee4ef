// SPDX-License-Identifier: Apache-2.0
#include "offload/map_downlink.hpp"

#include "offload/map_sync.hpp"

namespace slambed {

MapDownlink::MapDownlink(MobileNode& node, Channel& channel, DownlinkOptions options)
    : node_(node),
      inbox_(node, channel, options.rules, std::move(options.codec)),
      exchange_(node, inbox_),
      keeps_recovery_(options.recovery_keyframes > 0) {
  switch (options.mode) {
    case MapUpdateMode::kSerial:
      path_ = std::make_unique<SerialUpdates>(node, inbox_, exchange_, options.recovery_keyframes);
      break;
    case MapUpdateMode::kParallel:
    case MapUpdateMode::kParallelWaiting:
      path_ = std::make_unique<ParallelUpdates>(node, inbox_, exchange_,
                                                options.mode == MapUpdateMode::kParallelWaiting);
      break;
    case MapUpdateMode::kStaged:
      path_ = std::make_unique<StagedUpdates>(node, inbox_, exchange_, options.backup,
                                              options.recovery_keyframes);
      break;
  }
}

void MapDownlink::before_frame(Worker& worker) {
  inbox_.look();
  path_->before_frame(worker);
}

void MapDownlink::recovered(RunTime when, KeyFrameId reference) {
  if (keeps_recovery_) inbox_.recovered(when);
  path_->recovered(when, reference);
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
