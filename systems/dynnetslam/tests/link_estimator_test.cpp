// SPDX-License-Identifier: Apache-2.0
// The RTT that a mobile node decides with.
#include "dynnetslam/link_estimator.hpp"

#include <gtest/gtest.h>

#include "base/error.hpp"
#include "node/messaging.hpp"
#include "offload/tests/two_nodes.hpp"

namespace slambed::testing {
namespace {

using namespace std::chrono_literals;

LinkOptions options(RttSource source = RttSource::kTcpInfo, double probe_hz = 10) {
  return {.source = source, .missing = 2s, .probe_hz = probe_hz, .probe_bytes = 64};
}

struct Estimator : ::testing::Test {
  TwoNodes nodes;
  std::pair<Channel&, Channel&> ends = nodes.open({.name = "keyframe"});
};

TEST_F(Estimator, AnEchoCountsAnEighthOfWhatItChanges) {
  LinkEstimator link(nodes.mobile, ends.first, options(RttSource::kEcho));
  link.received(1s);
  EXPECT_EQ(link.rtt(1s), std::nullopt) << "none measured";
  link.count(80ms);
  EXPECT_EQ(link.rtt(1s), 80ms);
  link.count(160ms);
  EXPECT_EQ(link.rtt(1s), 90ms);
  link.count(10ms);
  EXPECT_EQ(link.rtt(1s), 80ms);
}

TEST_F(Estimator, AnAnswerIsMeasuredFromItsOwnQuestion) {
  LinkEstimator link(nodes.mobile, ends.first, options());
  link.asked(5, 100ms);
  link.asked(6, 200ms);
  link.asked(7, 300ms);
  EXPECT_EQ(link.answered(6, 250ms), 50ms);
  EXPECT_EQ(link.answered(6, 260ms), std::nullopt) << "answered before";
  EXPECT_EQ(link.answered(5, 260ms), std::nullopt) << "a later one was answered first";
  EXPECT_EQ(link.answered(9, 260ms), std::nullopt);
  EXPECT_EQ(link.answered(7, 500ms), std::nullopt) << "given up with what was before 9";
}

TEST_F(Estimator, OldQuestionsAreGivenUp) {
  LinkEstimator link(nodes.mobile, ends.first, options());
  for (std::uint64_t i = 1; i <= 65; ++i) link.asked(i, 1ms * i);
  EXPECT_EQ(link.answered(1, 1s), std::nullopt);
  EXPECT_EQ(link.answered(2, 1s), 998ms);
}

TEST_F(Estimator, WithoutAConnectionThereIsOneAsLongAsSomethingCame) {
  LinkEstimator link(nodes.mobile, ends.first, options(RttSource::kEcho));
  link.count(80ms);
  nodes.on_mobile([&](Worker& worker) {
    nodes.link.freeze_edge(true);
    worker.sleep_until(4s);
    EXPECT_FALSE(nodes.mobile.network().peer().connected);
    link.received(2s);
    EXPECT_EQ(link.rtt(4s), 80ms);
    EXPECT_EQ(link.rtt(4001ms), std::nullopt);
    nodes.link.freeze_edge(false);
    worker.sleep_until(5s);
    EXPECT_EQ(link.rtt(worker.now()), 80ms);
  });
  nodes.run_until(6s);
}

TEST_F(Estimator, TheTransportIsAskedByDefault) {
  LinkEstimator link(nodes.mobile, ends.first, options());
  nodes.on_mobile([&](Worker& worker) {
    for (int i = 0; i < 20; ++i) {
      send(ends.first, wire::kProbe, Bytes(64));
      worker.sleep_until(worker.now() + 100ms);
    }
    const auto rtt = link.rtt(worker.now());
    ASSERT_TRUE(rtt);
    EXPECT_NEAR(to_ms(*rtt), to_ms(2 * TwoNodes::kOneWay), 2);
  });
  nodes.run_until(3s);
}

TEST_F(Estimator, TheProfileHasToBeThereToBeAsked) {
  EXPECT_THROW(LinkEstimator(nodes.mobile, ends.first, options(RttSource::kProfile)), Error);
}

TEST_F(Estimator, ItProbesAtItsRateWhileNothingElseIsUnderWay) {
  LinkEstimator link(nodes.mobile, ends.first, options());
  nodes.on_mobile([&](Worker& worker) {
    worker.sleep_until(1s);
    EXPECT_EQ(link.probe(worker.now()), 1100ms);
    EXPECT_EQ(link.probe(worker.now()), 1100ms) << "not yet";
    worker.sleep_until(1100ms);
    send(ends.first, wire::kKeyFrame, Bytes(30'000));
    EXPECT_EQ(link.probe(worker.now()), 1200ms) << "what is under way gives a sample too";
  });
  nodes.run_until(3s);
  int probes = 0;
  while (const auto message = ends.second.try_receive()) probes += is(*message, wire::kProbe);
  EXPECT_EQ(probes, 1);
  LinkEstimator without(nodes.mobile, ends.first, options(RttSource::kTcpInfo, 0));
  EXPECT_EQ(without.probe(5s), kNever);
}

}  // namespace
}  // namespace slambed::testing
