// SPDX-License-Identifier: Apache-2.0
// Hand-over of a map to the edge: what is sent, how often, and when not.
#include <gtest/gtest.h>

#include "dynnetslam/handover_client.hpp"
#include "dynnetslam/handover_server.hpp"
#include "node/messaging.hpp"
#include "offload/tests/two_nodes.hpp"

namespace slambed::testing {
namespace {

using namespace std::chrono_literals;

/// A client with its owner's worker, and a server whose mapper has nothing to do.
class Handover : public ::testing::Test {
 protected:
  Handover() {
    inbox.on<wire::HandoverAck>(wire::decode_handover_ack,
                                [this](const wire::HandoverAck& ack, const Message& raw) {
                                  answers.push_back(ack);
                                  client.acknowledged(ack, raw.session, nodes.mobile_runtime.now());
                                });
    inbox.on<wire::AckMessage>(wire::decode_ack,
                               [this](const wire::AckMessage&, const Message&) { ++echoes; });
    nodes.on_mobile([this](Worker& worker) {
      while (!worker.stopping()) {
        const auto ticket = ends.first.signal().ticket();
        while (const auto message = ends.first.try_receive()) inbox.dispatch(*message);
        client.send_if_due(worker);
        worker.wait(ends.first.signal(), ticket, worker.now() + 100ms);
      }
    });
  }
  /// Makes calls of tracking at this time.
  void at(RunTime when, std::function<void()> act) {
    nodes.on_mobile([when, act = std::move(act)](Worker& worker) {
      worker.sleep_until(when);
      act();
    });
  }
  void run(bool with_edge = true) {
    if (with_edge) {
      mapping.start();
      server.start();
    }
    nodes.run_until(10s);
    sent = nodes.events("handover_sent");
  }
  MapCounts at_edge() { return count(*mapping.mapper().map()); }

  TwoNodes nodes;
  std::pair<Channel&, Channel&> ends = nodes.open({.name = "handover"});
  std::pair<Channel&, Channel&> keyframes = nodes.open({.name = "keyframe"});
  std::pair<Channel&, Channel&> maps = nodes.open({.name = "map"});
  HandoverClient client{nodes.mobile, ends.first};
  EdgeMapping mapping{
      nodes.edge,
      {.mapper = {.queue_limit = 3, .loop_closing = false}, .updates = {}, .prior_map = {}},
      keyframes.second,
      maps.second};
  HandoverServer server{nodes.edge, mapping, ends.second};
  Inbox inbox{nodes.mobile_log};
  SentTurn turn{5};
  std::vector<wire::HandoverAck> answers;
  int echoes = 0;
  std::vector<nlohmann::json> sent;
};

TEST_F(Handover, AnEmptyEdgeGetsAllOfItAndThenOnlyWhatChanged) {
  at(1s, [&] {
    client.begin(1, turn.map, false);
    EXPECT_TRUE(client.under_way());
  });
  at(3s, [&] {
    EXPECT_FALSE(client.under_way());
    EXPECT_EQ(at_edge().points, count(*turn.map).points);
    client.begin(1, turn.map, false);  // nothing has changed since
  });
  at(5s, [&] {
    EXPECT_FALSE(client.under_way());
    MapDelta moved;
    moved.epoch = turn.map->read([](const MapView& view) { return view.epoch(); });
    SE3 T_cw = turn.messages[3].delta.keyframes[0].T_cw;
    T_cw.t.x() += 1;
    moved.poses.push_back({turn.id(3), T_cw, 1000});
    turn.map->commit(moved);
    client.begin(1, turn.map, false);
  });
  run();
  ASSERT_EQ(sent.size(), 3u);
  EXPECT_EQ(sent[0]["whole"], true);
  EXPECT_EQ(sent[0]["keyframes"], 5);
  EXPECT_EQ(sent[1]["whole"], false);
  EXPECT_LT(sent[1]["bytes"], 10) << "START is enough";
  EXPECT_EQ(sent[2]["whole"], false);
  EXPECT_LT(sent[2]["bytes"], 1000);
  ASSERT_EQ(answers.size(), 3u);
  for (const auto& ack : answers) EXPECT_EQ(ack.answer, wire::HandoverAnswer::kAccepted);
  const double x = mapping.mapper().map()->read(
      [&](const MapView& view) { return view.keyframe(turn.id(3))->T_cw.t.x(); });
  EXPECT_NEAR(x, turn.messages[3].delta.keyframes[0].T_cw.t.x() + 1, 1e-6);
}

TEST_F(Handover, AnEdgeThatHasLostItsMapDeclinesChangesAndGetsAllOfIt) {
  at(1s, [&] {
    client.received(turn.map);  // as if the edge had sent it
    client.begin(1, turn.map, false);
  });
  run();
  ASSERT_EQ(sent.size(), 2u);
  EXPECT_EQ(sent[0]["whole"], false);
  EXPECT_EQ(sent[1]["whole"], true);
  ASSERT_EQ(answers.size(), 2u);
  EXPECT_EQ(answers[0].answer, wire::HandoverAnswer::kDeclined);
  EXPECT_EQ(answers[1].answer, wire::HandoverAnswer::kAccepted);
  EXPECT_FALSE(client.under_way());
  EXPECT_EQ(at_edge().points, count(*turn.map).points);
}

TEST_F(Handover, OneThatIsStoppedIsWorthNothingAnyMore) {
  at(1s, [&] { client.begin(1, turn.map, false); });
  at(1005ms, [&] {  // prepared, serialized, in transit
    client.stop(2);
    EXPECT_FALSE(client.under_way());
  });
  at(2s, [&] {
    EXPECT_EQ(mapping.mapper().keyframe_decline_reason(turn.messages[0]), "mapper stopped");
  });
  at(3s, [&] {
    client.begin(2, turn.map, false);
    EXPECT_TRUE(client.under_way());
  });
  run();
  EXPECT_EQ(sent.back()["epoch"], 2);
  EXPECT_FALSE(client.under_way());
  EXPECT_EQ(at_edge().points, count(*turn.map).points);
  EXPECT_NE(mapping.mapper().keyframe_decline_reason(turn.messages[0]), "mapper stopped");
}

TEST_F(Handover, ItIsSentOnceHoweverLongTheAnswerTakes) {
  at(1s, [&] { client.begin(1, turn.map, false); });
  run(false);  // no edge answers
  EXPECT_EQ(sent.size(), 1u);
  EXPECT_TRUE(client.under_way());
  int messages = 0;
  while (ends.second.try_receive()) ++messages;
  EXPECT_EQ(messages, 1);
}

TEST_F(Handover, AnEdgeWithoutAMapSaysSoToEachState) {
  at(1s,
     [&] { send(ends.first, wire::StateMessage{.state = 0, .epoch = 4, .time = 1s, .rtt = {}}); });
  at(2s, [&] { client.begin(4, turn.map, true); });
  at(4s,
     [&] { send(ends.first, wire::StateMessage{.state = 0, .epoch = 4, .time = 4s, .rtt = {}}); });
  run();
  EXPECT_EQ(echoes, 2);
  ASSERT_EQ(answers.size(), 2u) << "none to the second";
  EXPECT_EQ(answers[0].answer, wire::HandoverAnswer::kNoMap);
  EXPECT_EQ(answers[0].epoch, 4u);
  EXPECT_EQ(answers[1].answer, wire::HandoverAnswer::kAccepted);
}

TEST_F(Handover, OneOfAnOlderEpochChangesNothing) {
  at(1s, [&] { client.stop(3); });
  at(2s, [&] {
    send(ends.first,
         wire::MapHandover{
             .epoch = 2, .number = 9, .whole = true, .changes = turn.map->read(snapshot)});
    send(ends.first, wire::StartMessage{2, 10});
  });
  run();
  EXPECT_EQ(nodes.events("handover_declined").size(), 2u);
  EXPECT_TRUE(answers.empty());
  EXPECT_EQ(at_edge().keyframes, 0u);
}

}  // namespace
}  // namespace slambed::testing
