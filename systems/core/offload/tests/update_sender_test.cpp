// SPDX-License-Identifier: Apache-2.0
// When a part of the global map is sent to the mobile, and which part.
#include "offload/edge/update_sender.hpp"

#include <gtest/gtest.h>

#include "offload/maps/update_content.hpp"
#include "offload/tests/two_nodes.hpp"

namespace slambed::testing {
namespace {

using namespace std::chrono_literals;

UpdateSenderOptions carrying(int keyframes, Duration period = {}, bool keep_recovery = false) {
  return {.keyframes = keyframes,
          .neighbors = 0,
          .period = period,
          .poses = true,
          .keep_recovery = keep_recovery,
          .codec = {}};
}

/// The sender of an edge whose map has eight keyframes; nothing is mapped meanwhile.
class Sender : public ::testing::Test {
 protected:
  void begin(UpdateSenderOptions options) {
    sender.emplace(nodes.edge, mapper, std::move(options), ends.second);
  }
  /// Runs the function on the edge's mapping worker at this time.
  void at(RunTime when, std::function<void(Worker&)> act) {
    nodes.on_edge([when, act = std::move(act)](Worker& worker) {
      worker.sleep_until(when);
      act(worker);
    });
  }
  void run() {
    nodes.run_until(20s);
    while (const auto message = ends.first.try_receive()) {
      types.push_back(message->type);
      queued.push_back(message->queued);
      updates.push_back(wire::decode_update(message->payload, nodes.source.sensor()));
    }
  }
  wire::KeyFrameMessage keyframe(RunTime captured, std::uint64_t applied = 0) {
    wire::KeyFrameMessage message;
    message.captured = captured;
    message.applied_update = applied;
    return message;
  }

  TwoNodes nodes;
  std::pair<Channel&, Channel&> ends = nodes.open({.name = "map"});
  SentTurn turn{8};
  EdgeMapper mapper{
      nodes.edge, {.queue_limit = 3, .loop_closing = false, .prior = turn.map}, EdgeHooks()};
  std::optional<UpdateSender> sender;
  std::vector<std::uint8_t> types;
  std::vector<RunTime> queued;
  std::vector<wire::MapUpdate> updates;
};

TEST_F(Sender, NewsLeavesWhenItIsDueWithTheLatestKeyframes) {
  begin(carrying(3, 5s));
  std::vector<RunTime> due;
  at(1s, [&](Worker& worker) {
    due.push_back(sender->send_if_due(worker));
    sender->mapped(worker, {.captured = 800ms});
    due.push_back(sender->send_if_due(worker));
  });
  at(5s, [&](Worker& worker) {
    due.push_back(sender->send_if_due(worker));
    due.push_back(sender->send_if_due(worker));
  });
  at(6s, [&](Worker& worker) {
    sender->mapped(worker, {});
    due.push_back(sender->send_if_due(worker));
  });
  run();
  ASSERT_EQ(due.size(), 5u);
  EXPECT_EQ(due[0], kNever) << "no news";
  EXPECT_EQ(due[1], 5s) << "one period after the start";
  EXPECT_EQ(due[2], kNever) << "sent";
  EXPECT_EQ(due[3], kNever) << "no news since";
  EXPECT_GT(due[4], 10s);
  EXPECT_LT(due[4], 10.1s);
  ASSERT_EQ(updates.size(), 1u);
  EXPECT_EQ(types[0], wire::type_of(wire::kMapUpdate));
  EXPECT_EQ(updates[0].newest, turn.id(7));
  EXPECT_EQ(updates[0].times.captured, 800ms);
  EXPECT_EQ(updates[0].times.due, 5s);
  EXPECT_EQ(keyframes_of(updates[0].map),
            (std::vector<KeyFrameId>{turn.id(5), turn.id(6), turn.id(7)}));
}

TEST_F(Sender, WhileTheMobileAsksWhereItIsOnlyTheAnswerLeaves) {
  begin(carrying(1));
  at(1s, [&](Worker& worker) {
    sender->suspend(1s);
    sender->mapped(worker, {});
    sender->send(worker, {}, turn.id(7), {turn.id(2)}, true);
    sender->keyframe_received(keyframe(999ms));  // made before the mobile asked
    sender->mapped(worker, {});
  });
  at(2s, [&](Worker& worker) {
    sender->keyframe_received(keyframe(1500ms));
    sender->send_if_due(worker);
  });
  run();
  ASSERT_EQ(updates.size(), 2u);
  EXPECT_EQ(types[0], wire::type_of(wire::kRelocMap));
  EXPECT_EQ(keyframes_of(updates[0].map), std::vector<KeyFrameId>{turn.id(2)});
  EXPECT_EQ(types[1], wire::type_of(wire::kMapUpdate));
  EXPECT_GE(queued[1], 2s);
}

TEST_F(Sender, OneThatIsBeingPreparedWhenTheMobileAsksStays) {
  begin(carrying(1));
  at(1s, [&](Worker& worker) { sender->mapped(worker, {}); });
  at(1001ms, [&](Worker&) { sender->suspend(1001ms); });  // preparing takes 2 ms
  run();
  EXPECT_TRUE(updates.empty());
}

TEST_F(Sender, NothingLeavesWhileMappingRestsAndThenUnderTheNewEpoch) {
  begin(carrying(1));
  at(1s, [&](Worker& worker) {
    sender->stop();
    sender->mapped(worker, {});
    sender->send(worker, {}, turn.id(7), {turn.id(2)}, true);
  });
  at(2s, [&](Worker& worker) {
    sender->resume(7);
    sender->send_if_due(worker);
  });
  run();
  ASSERT_EQ(updates.size(), 1u);
  EXPECT_EQ(updates[0].map.epoch, 7u);
  EXPECT_GE(queued[0], 2s);
}

TEST_F(Sender, PosesOfOtherKeyframesAreToldUntilAnUpdateWithThemIsConfirmed) {
  begin(carrying(1));
  const auto news = [this](Worker& worker) { sender->mapped(worker, {}); };
  const auto move = [this](std::size_t place, std::uint32_t version) {
    MapDelta moved;
    moved.epoch = turn.map->read([](const MapView& view) { return view.epoch(); });
    SE3 T_cw = turn.messages[place].delta.keyframes[0].T_cw;
    T_cw.t.x() += 1;
    moved.poses.push_back({turn.id(place), T_cw, version});
    turn.map->commit(moved);
  };
  at(1s, news);
  at(2s, [&](Worker& worker) {
    move(3, 1000);
    news(worker);
  });
  at(3s, news);
  at(4s, [&](Worker& worker) {
    sender->keyframe_received(keyframe(0s, 2));
    news(worker);
  });
  at(5s, [&](Worker& worker) {
    move(4, 1001);
    news(worker);
  });
  run();
  ASSERT_EQ(updates.size(), 5u);
  EXPECT_TRUE(updates[0].poses.empty()) << "the map began with them, and none has moved";
  ASSERT_EQ(updates[1].poses.size(), 1u);
  EXPECT_EQ(updates[1].poses[0].id, turn.id(3));
  EXPECT_EQ(updates[2].poses.size(), 1u) << "the one before may have been dropped on its way";
  EXPECT_TRUE(updates[3].poses.empty());
  ASSERT_EQ(updates[4].poses.size(), 1u);
  EXPECT_EQ(updates[4].poses[0].id, turn.id(4));
}

TEST_F(Sender, PosesAreToldAllWhenTheMapBeginsAnew) {
  begin(carrying(1));
  at(1s, [&](Worker& worker) {
    sender->clear();
    sender->mapped(worker, {});
  });
  run();
  ASSERT_EQ(updates.size(), 1u);
  EXPECT_EQ(updates[0].poses.size(), 7u);
}

TEST_F(Sender, AfterARecoveryItRestsAndThenShowsThatPlaceToo) {
  begin(carrying(2, {}, true));
  at(1s, [&](Worker& worker) {
    sender->suspend(1s);
    sender->recovered(1500ms, turn.id(0));
    sender->mapped(worker, {.captured = 1200ms});
    EXPECT_EQ(sender->send_if_due(worker), 3500ms);
  });
  at(4s, [&](Worker& worker) { sender->send_if_due(worker); });
  at(5s, [&](Worker& worker) {  // as many keyframes as an update has
    sender->mapped(worker, {.captured = 4500ms});
    sender->mapped(worker, {.captured = 4600ms});
  });
  run();
  ASSERT_EQ(updates.size(), 3u);
  const std::vector<KeyFrameId> with_it{turn.id(0), turn.id(6), turn.id(7)};
  EXPECT_EQ(keyframes_of(updates[0].map), with_it);
  EXPECT_EQ(keyframes_of(updates[1].map), with_it);
  EXPECT_EQ(keyframes_of(updates[2].map), (std::vector<KeyFrameId>{turn.id(6), turn.id(7)}));
}

}  // namespace
}  // namespace slambed::testing
