// SPDX-License-Identifier: Apache-2.0
// Map updates that arrive at the mobile, and what it knows of the last one applied.
#include "offload/downlink/update_check.hpp"

#include <gtest/gtest.h>

#include "node/messaging.hpp"
#include "offload/maps/update_content.hpp"
#include "offload/tests/two_nodes.hpp"

namespace slambed::testing {
namespace {

using namespace std::chrono_literals;

class UpdatesReceived : public ::testing::Test {
 protected:
  wire::MapUpdate update(std::uint64_t number, std::size_t newest) {
    wire::MapUpdate made;
    made.update = number;
    made.newest = turn.id(newest);
    const std::vector<KeyFrameId> ids{turn.id(newest)};
    made.map = turn.map->read([&](const MapView& view) { return extract_keyframes(view, ids); });
    return made;
  }
  UpdateArrival arrival(const wire::MapUpdate& update, std::uint64_t session = 0) {
    UpdateArrival made{.raw = {}, .update = update, .map = nullptr};
    made.raw.type = wire::type_of(wire::kMapUpdate);
    made.raw.session = session;
    return made;
  }
  /// Runs the function on the mobile while it is connected.
  void run(std::function<void(Worker&)> act) {
    nodes.on_mobile([act = std::move(act)](Worker& worker) {
      worker.sleep_until(1s);
      act(worker);
    });
    nodes.run_until(3s);
  }
  std::uint64_t edge() { return nodes.mobile.network().peer().session; }

  TwoNodes nodes;
  std::pair<Channel&, Channel&> ends = nodes.open({.name = "map"});
  SentTurn turn{4};
  UpdateReceiver receiver{nodes.mobile, ends.first, {}};
  UpdateCheck check{nodes.mobile, {.min_local_keyframes = 0}};
};

TEST_F(UpdatesReceived, OnlyUpdatesAreTakenAndWhatCannotBeReadIsRefused) {
  nodes.on_edge([&](Worker&) {
    send(ends.second, wire::kProbe, Bytes(64));
    send(ends.second, wire::kMapUpdate, encode(update(1, 2)));
    send(ends.second, wire::kRelocMap, encode(update(2, 3)));
    send(ends.second, wire::kMapUpdate, Bytes(50, 9));
  });
  run([&](Worker& worker) {
    const auto regular = receiver.read(worker, receiver.take().value());
    ASSERT_TRUE(regular);
    EXPECT_EQ(regular->update.update, 1u);
    EXPECT_EQ(regular->update.newest, turn.id(2));
    EXPECT_FALSE(regular->relocalization());
    EXPECT_TRUE(regular->raw.payload.empty());
    EXPECT_TRUE(receiver.read(worker, receiver.take().value())->relocalization());
    EXPECT_FALSE(receiver.read(worker, receiver.take().value()));
    EXPECT_FALSE(receiver.take());
  });
  EXPECT_EQ(nodes.events("update_received").size(), 2u);
  EXPECT_EQ(nodes.events("warning").size(), 1u);
}

TEST_F(UpdatesReceived, OneThatIsNoNewerThanTheMapIsDeclined) {
  run([&](Worker& worker) {
    check.keyframe_created(worker.now());
    EXPECT_EQ(check.update_decline_reason(worker, arrival(update(5, 2), edge())), std::nullopt);
    check.applied(arrival(update(5, 2), edge()), false);
    EXPECT_EQ(check.applied_update(), 5u);
    EXPECT_EQ(check.update_decline_reason(worker, arrival(update(5, 2), edge())),
              "older than the map");
    EXPECT_EQ(check.update_decline_reason(worker, arrival(update(6, 3), edge())), "up to date")
        << "no keyframe since";
    check.keyframe_created(worker.now());
    EXPECT_EQ(check.update_decline_reason(worker, arrival(update(6, 3), edge())), std::nullopt);
  });
}

TEST_F(UpdatesReceived, AnotherEdgeCountsItsOwn) {
  run([&](Worker& worker) {
    check.keyframe_created(worker.now());
    auto carrier = update(5, 3);
    carrier.newest_past_probation = turn.id(1);
    check.applied(arrival(carrier, edge()), true);
    EXPECT_EQ(check.newest_past_probation(), turn.id(1));
    EXPECT_EQ(check.update_decline_reason(worker, arrival(update(9, 3), edge() + 1)),
              "its edge is gone");
    check.applied(arrival(carrier, edge() + 1), true);  // from an edge that is not connected
    EXPECT_EQ(check.applied_update(), 0u);
    EXPECT_EQ(check.newest_past_probation(), KeyFrameId{});
    EXPECT_EQ(check.update_decline_reason(worker, arrival(update(1, 3), edge())), std::nullopt);
  });
}

TEST_F(UpdatesReceived, EpochsRecoveriesAndKeyframesSentLateMakeOneObsolete) {
  run([&](Worker& worker) {
    check.keyframe_created(worker.now());
    auto older = arrival(update(3, 2), edge());
    older.raw.queued = worker.now();
    EXPECT_EQ(check.obsolete_reason(worker, older), std::nullopt);
    check.recovered(worker.now() + 1ms);
    EXPECT_EQ(check.obsolete_reason(worker, older), "from before the recovery");
    older.raw.queued = worker.now() + 1ms;
    check.expect_keyframe(turn.id(3));
    EXPECT_EQ(check.update_decline_reason(worker, older), "the edge catches up");
    check.expect_keyframe(turn.id(2));
    EXPECT_EQ(check.update_decline_reason(worker, older), std::nullopt);
    check.applied(older, true);
    check.begin_epoch(1);
    EXPECT_EQ(check.applied_update(), 0u);
    EXPECT_EQ(check.update_decline_reason(worker, older), "older epoch");
  });
}

TEST_F(UpdatesReceived, PosesOfADeclinedOneAreKept) {
  run([&](Worker& worker) {
    auto carrier = update(3, 2);
    SE3 T_cw = carrier.map.keyframes[0].T_cw;
    T_cw.t.x() += 1;
    carrier.poses.push_back({turn.id(0), T_cw, 1});
    check.keep_poses(worker, arrival(carrier, edge() + 1));
    EXPECT_FALSE(nodes.mobile.poses().pose(turn.id(0))) << "of an edge that is gone";
    check.keep_poses(worker, arrival(carrier, edge()));
    EXPECT_EQ(nodes.mobile.poses().pose(turn.id(0))->t, T_cw.t);
    EXPECT_TRUE(nodes.mobile.poses().pose(turn.id(2)));
  });
}

}  // namespace
}  // namespace slambed::testing
