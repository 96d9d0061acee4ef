// SPDX-License-Identifier: Apache-2.0
#include "dynnetslam/handover_client.hpp"

#include "map/map_snapshot.hpp"
#include "node/messaging.hpp"
#include "offload/maps/map_sync.hpp"
#include "wire/message_type.hpp"

namespace slambed {
namespace {

/// Delay before an edge that declined a whole map gets it again, in its state at that time.
constexpr Duration kNextWhole = std::chrono::seconds(2);

}  // namespace

void HandoverClient::begin(std::uint64_t epoch, std::shared_ptr<Map> map, bool edge_is_empty) {
  {
    std::lock_guard lock(mutex_);
    if (edge_is_empty) acknowledged_ = {};
    map_ = std::move(map);
    handover_ = {};
    handover_.epoch = epoch;
    handover_.asked = node_.runtime().now();
    under_way_ = true;
  }
  channel_.signal().notify();
}

void HandoverClient::stop(std::uint64_t epoch) {
  std::lock_guard lock(mutex_);
  map_.reset();
  handover_ = {};
  under_way_ = false;
  slambed::send(channel_, wire::StopMessage{epoch});
}

void HandoverClient::received(std::shared_ptr<const Map> map) {
  auto content = std::make_shared<const MapDelta>(map->read(snapshot));
  const std::uint64_t edge = node_.network().peer().session;
  std::lock_guard lock(mutex_);
  acknowledged_ = {std::move(map), std::move(content), edge};
  handover_.superseded = true;
}

void HandoverClient::send_if_due(Worker& worker) {
  const PathStats path = channel_.path();
  if (!path.connected) return;  // the channel's signal reports when it is
  const std::uint64_t edge = node_.network().peer().session;
  Handover handover;
  AcknowledgedMap base;
  {
    std::lock_guard lock(mutex_);
    if (!map_) return;
    if (handover_.sent && handover_.acknowledged.edge == edge) {
      if (handover_.connection != path.connections) send(handover_);
      return;
    }
    if (worker.now() < handover_.not_before) return;
    handover_.number = ++handovers_;
    handover_.sent = true;
    handover_.acknowledged = {map_, nullptr, edge};
    handover = handover_;
    base = acknowledged_.edge == edge ? acknowledged_ : AcknowledgedMap();
  }
  prepare(worker, std::move(handover), std::move(base));
}

void HandoverClient::prepare(Worker& worker, Handover handover, AcknowledgedMap base) {
  wire::MapHandover message{.epoch = handover.epoch,
                            .number = handover.number,
                            .whole = base.map != handover.acknowledged.map,
                            .changes = {}};
  handover.whole = message.whole;
  worker.stage("prepare_update", [&](StageUnits& units) {
    const MapDelta none;
    const MapDelta& earlier = message.whole ? none : *base.content;
    MapCopy copy = copy_of(*handover.acknowledged.map, earlier);
    message.changes = message.whole ? copy.whole : changes_since(earlier, copy);
    handover.acknowledged.content = std::make_shared<const MapDelta>(std::move(copy.whole));
    message.changes.epoch = handover.epoch;
    units.n1 = static_cast<double>(message.changes.keyframes.size());
    units.n2 = static_cast<double>(message.changes.points.size());
    return 0;
  });
  const bool start = !message.whole && message.changes.empty();
  handover.type = start ? wire::StartMessage::kType : wire::MapHandover::kType;
  handover.payload = worker.stage("serialize", [&](StageUnits& units) {
    Bytes bytes =
        start ? encode(wire::StartMessage{handover.epoch, handover.number}) : encode(message);
    units.n1 = static_cast<double>(bytes.size()) / 1000;
    return bytes;
  });
  {
    std::lock_guard lock(mutex_);
    if (handover_.number != handover.number) return;  // stopped meanwhile
    handover.superseded = handover_.superseded;
    handover_ = handover;
    send(handover_);
  }
  node_.log().write(JsonLine("handover_sent")
                        .add("epoch", handover.epoch)
                        .add("number", handover.number)
                        .add("whole", message.whole)
                        .add("keyframes", message.changes.keyframes.size())
                        .add("points", message.changes.points.size())
                        .add("bytes", handover.payload.size()));
}

void HandoverClient::send(Handover& handover) {
  handover.connection = channel_.path().connections;
  slambed::send(channel_, handover.type, handover.payload);
}

void HandoverClient::acknowledged(const wire::HandoverAck& ack, std::uint64_t edge, RunTime now) {
  JsonLine event("handover_acknowledged");
  const bool accepted = ack.answer == wire::HandoverAnswer::kAccepted;
  event.add("epoch", ack.epoch).add("number", ack.number).add("accepted", accepted);
  {
    std::lock_guard lock(mutex_);
    const bool current = handover_.sent && ack.number == handover_.number;
    if (!map_ || ack.epoch != handover_.epoch || edge != handover_.acknowledged.edge) {
      event.add("stale", true);
    } else if (accepted) {
      event.add_ms("handover_ms", now - handover_.asked);
      if (!handover_.superseded)
        acknowledged_ = current ? std::move(handover_.acknowledged) : AcknowledgedMap();
      handover_ = {};
      map_.reset();
      under_way_ = false;
    } else if (current) {
      acknowledged_ = {};  // the edge lost its map or cannot read this: send all of it
      handover_.sent = false;
      if (handover_.whole) handover_.not_before = now + kNextWhole;
    }
  }
  node_.log().write(event);
}

}  // namespace slambed
