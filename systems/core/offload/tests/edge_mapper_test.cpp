// SPDX-License-Identifier: Apache-2.0
// The edge's global map: which keyframes it has admitted and mapped, and when it starts over.
#include "offload/edge/edge_mapper.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "offload/maps/update_content.hpp"
#include "offload/tests/two_nodes.hpp"

namespace slambed::testing {
namespace {

using namespace std::chrono_literals;

class Mapper : public ::testing::Test {
 protected:
  EdgeHooks hooks() {
    return {.begun = [this] { ++keyframes_begun; },
            .mapped = [this](Worker&, const wire::UpdateTimes& times) { mapped.push_back(times); },
            .idle = [](Worker&) { return kNever; },
            .cleared = [this] { ++cleared; }};
  }
  void admit(EdgeMapper& mapper, Worker& worker, std::size_t place) {
    mapper.admit(worker, {.message = turn.messages[place], .times = {}});
  }

  TwoNodes nodes;
  SentTurn turn{6};
  int keyframes_begun = 0, cleared = 0;
  std::vector<wire::UpdateTimes> mapped;
};

TEST_F(Mapper, KeyframesAreMappedInTheOrderOfTheirAdmission) {
  EdgeMapper mapper(nodes.edge, {.queue_limit = 3, .loop_closing = false}, hooks());
  mapper.start();
  EXPECT_TRUE(mapper.latest(3).empty());
  EXPECT_FALSE(mapper.newest());
  nodes.on_edge([&](Worker& worker) {
    for (std::size_t i = 0; i < 3; ++i) admit(mapper, worker, i);
    EXPECT_EQ(mapper.all_poses().size(), 0u) << "none is in the map yet";
    mapper.drain(worker, 10s);
  });
  nodes.run_until(20s);
  EXPECT_EQ(keyframes_begun, 3);
  ASSERT_EQ(mapped.size(), 3u);
  EXPECT_LT(mapped[0].mapped, mapped[1].mapped);
  EXPECT_EQ(mapper.newest(), turn.id(2));
  EXPECT_EQ(mapper.latest(2), (std::vector<KeyFrameId>{turn.id(2), turn.id(1)}));
  EXPECT_EQ(mapper.all_poses().size(), 3u);
  EXPECT_EQ(mapper.newest_past_probation(), KeyFrameId{})
      << "points of the last keyframes are still counted";
}

TEST_F(Mapper, ASecondFirstKeyframeBeginsANewMap) {
  EdgeMapper mapper(nodes.edge, {.queue_limit = 3, .loop_closing = false}, hooks());
  mapper.start();
  nodes.on_edge([&](Worker& worker) {
    for (std::size_t i = 0; i < 3; ++i) admit(mapper, worker, i);
    mapper.drain(worker, 10s);
    admit(mapper, worker, 0);
    mapper.drain(worker, 10s);
  });
  nodes.run_until(20s);
  EXPECT_EQ(cleared, 1);
  EXPECT_EQ(mapper.latest(5), std::vector<KeyFrameId>{turn.id(0)});
  EXPECT_EQ(mapper.all_poses().size(), 1u);
}

TEST_F(Mapper, WhatIsMergedTakesThePlaceOfWhatWaited) {
  EdgeMapper mapper(nodes.edge, {.queue_limit = 3, .loop_closing = false}, hooks());
  mapper.start();
  nodes.on_edge([&](Worker& worker) {
    admit(mapper, worker, 0);
    mapper.drain(worker, 10s);
    mapper.park(true);
    EXPECT_EQ(mapper.keyframe_decline_reason(turn.messages[1]), "mapper stopped");
    admit(mapper, worker, 1);  // arrived before mapping was parked
    MapDelta changes = turn.map->read(snapshot);
    EXPECT_EQ(mapper.merge(worker, std::move(changes)).unknown, 0);
    mapper.park(false);
    mapper.drain(worker, 10s);
  });
  nodes.run_until(20s);
  EXPECT_EQ(mapped.size(), 1u) << "the one that waited came with the changes";
  EXPECT_EQ(mapper.newest(), turn.id(5));
  EXPECT_EQ(mapper.all_poses().size(), 6u);
  EXPECT_EQ(count(*mapper.map()).keyframes, 6u);
  EXPECT_EQ(mapper.keyframe_decline_reason(turn.messages[2]), "older than the last accepted");
}

TEST_F(Mapper, OneThatBeginsWithAMapTakesKeyframesThatJoinIt) {
  const auto begun = std::make_shared<Map>();
  for (std::size_t i = 0; i < 3; ++i) begun->commit(turn.messages[i].delta);
  EdgeMapper empty(nodes.edge, {.queue_limit = 3, .loop_closing = false}, hooks());
  EdgeMapper mapper(nodes.edge, {.queue_limit = 3, .loop_closing = false, .prior = begun}, hooks());
  mapper.start();
  EXPECT_NE(empty.keyframe_decline_reason(turn.messages[3]), std::nullopt);
  EXPECT_EQ(mapper.keyframe_decline_reason(turn.messages[3]), std::nullopt);
  EXPECT_EQ(mapper.latest(2), (std::vector<KeyFrameId>{turn.id(2), turn.id(1)}));
  nodes.on_edge([&](Worker& worker) {
    admit(mapper, worker, 3);
    mapper.drain(worker, 10s);
  });
  nodes.run_until(20s);
  EXPECT_EQ(cleared, 0);
  EXPECT_EQ(mapper.newest(), turn.id(3));
  const auto covisible = begun->read(
      [&](const MapView& view) { return view.keyframe(turn.id(3))->covisibles.front().id; });
  EXPECT_EQ(mapper.latest(2), (std::vector<KeyFrameId>{turn.id(3), covisible}));
  EXPECT_EQ(mapper.all_poses().size(), 4u);
  EXPECT_EQ(begun->read(
                [&](const MapView& view) { return view.keyframe(turn.id(3))->covisibles.empty(); }),
            false)
      << "it sees points that were there";
}

TEST_F(Mapper, AfterARestartTheFirstKeyframeJoinsTheStoredMap) {
  // Each edge process opens the map file as stored, without the trip so far.
  const auto stored = std::make_shared<Map>();
  for (std::size_t i = 0; i < 3; ++i) stored->commit(turn.messages[i].delta);
  EdgeMapper mapper(nodes.edge, {.queue_limit = 3, .loop_closing = false, .prior = stored},
                    hooks());
  mapper.start();
  wire::KeyFrameMessage first = turn.messages[5];
  first.first = first.whole = true;
  first.delta = turn.map->read(
      [&](const MapView& view) { return extract_keyframes(view, std::vector{turn.id(5)}); });
  const std::size_t points = count(*stored).points;
  nodes.on_edge([&](Worker& worker) {
    ASSERT_EQ(mapper.keyframe_decline_reason(first), std::nullopt);
    mapper.admit(worker, {.message = first, .times = {}});
    mapper.drain(worker, 10s);
  });
  nodes.run_until(20s);
  EXPECT_EQ(cleared, 0);
  EXPECT_EQ(count(*stored).keyframes, 4u);
  EXPECT_GT(count(*stored).points, points) << "it brings those that only the trip had";
  EXPECT_EQ(mapper.newest(), turn.id(5));
  const bool joined = stored->read([&](const MapView& view) {
    return std::ranges::any_of(view.keyframe(turn.id(5))->covisibles,
                               [&](const Covisible& near) { return near.id == turn.id(2); });
  });
  EXPECT_TRUE(joined) << "it sees points of the stored map";
}

}  // namespace
}  // namespace slambed::testing
