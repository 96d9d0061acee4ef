// SPDX-License-Identifier: Apache-2.0
// Loops closed in the edge's map while the mobile tracks in a local map without them.
#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "edgeslam/edgeslam.hpp"
#include "offload/nodes/offload_edge.hpp"
#include "offload/tests/turning_pair.hpp"

namespace slambed {
namespace {

using testing::PairResult;
using testing::pose_at;
using testing::through_a_wrong_lens;

/// Frames of one lap, and of enough of the next to close the loop.
constexpr int kLap = 144, kFrames = 176;

PairResult two_laps(const System& system, bool loop_closing, double bundle_us = 2000) {
  auto params = testing::enhanced();
  if (system.name == "edgeslam") params.update(testing::ours());
  params["fast_motion_ms"] = 0.0;
  params["n_kf"] = 6;
  params["loop_closing"] = loop_closing;
  return testing::run_pair(system, params, kFrames, 10,
                           {.one_way_ms = {100}, .edge_bundle_us = bundle_us},
                           through_a_wrong_lens);
}

/// Rotation error of each second-lap keyframe against the first lap, which is drift.
std::map<std::uint64_t, double> drift_deg(const PairResult& result) {
  std::map<std::uint64_t, double> drift;
  for (const NewKeyFrame& keyframe : result.edge_map.keyframes) {
    const int frame = static_cast<int>(keyframe.frame_index);
    if (frame < kLap) continue;
    drift[keyframe.id.value] =
        testing::turn_error_deg(keyframe.T_cw, pose_at(frame - kLap) * pose_at(0).inverse());
  }
  return drift;
}

/// Limits with a closed loop and without.
constexpr double kInPlace_deg = 1, kDrifted_deg = 2;

/// Expects that keyframes received after the first loop was closed agree with the corrected map.
/// Returns how many there were.
int expect_all_in_place(const PairResult& result) {
  const auto closed = result.of("loop_closed");
  if (closed.empty()) return 0;
  const double closed_ns = closed.front()["t_ns"];
  const auto drift = drift_deg(result);
  int later = 0;
  for (const auto& keyframe : result.of("keyframe_received")) {
    const auto found = drift.find(keyframe["keyframe"].get<std::uint64_t>());
    if (keyframe["t_ns"].get<double>() < closed_ns || found == drift.end()) continue;
    EXPECT_LT(found->second, kInPlace_deg) << keyframe;
    ++later;
  }
  return later;
}

TEST(EdgeLoops, KeyframesUnderWayToAClosedLoopLandWhereItBelongs) {
  const PairResult result = two_laps(edgeslam_system(), true);
  const auto closed = result.of("loop_closed");
  ASSERT_FALSE(closed.empty());
  EXPECT_TRUE(result.of("track_lost").empty());
  const double closed_ns = closed.front()["t_ns"];
  const auto received = result.of("keyframe_received");
  int under_way = 0;
  for (const auto& sent : result.of("keyframe_sent")) {
    under_way += sent["t_ns"].get<double>() < closed_ns &&
                 std::any_of(received.begin(), received.end(), [&](const auto& keyframe) {
                   return keyframe["keyframe"] == sent["keyframe"] &&
                          keyframe["t_ns"].template get<double>() > closed_ns;
                 });
  }
  EXPECT_GT(under_way, 0);
  EXPECT_GT(expect_all_in_place(result), under_way);
}

TEST(EdgeLoops, WithoutLoopClosingTheDriftStays) {
  const PairResult result = two_laps(edgeslam_system(), false);
  EXPECT_TRUE(result.of("loop_closed").empty());
  for (const auto& stage : result.of("stage")) EXPECT_NE(stage["name"], "loop_detect");
  const auto drift = drift_deg(result);
  ASSERT_FALSE(drift.empty());
  for (const auto& [keyframe, deg] : drift) EXPECT_GT(deg, kDrifted_deg) << keyframe;
}

/// The id of no keyframe, which marks the update.
constexpr std::uint64_t kMeanwhile = std::uint64_t{1} << 56 | 999'999;

/// Sends an update while the first loop is being closed, as answers to a lost mobile may be.
class SendsWhileClosing final : public EdgePolicy {
 public:
  SendsWhileClosing(EdgeNode& node, const Parameters& parameters)
      : node_(node), offload_(node, parameters) {}
  void start() override {
    offload_.start();
    node_.runtime().spawn("meanwhile", [this](Worker& worker) {
      EdgeMapper& edge = offload_.mapping().mapper();
      while (edge.status().accepts && !worker.stopping()) {
        worker.sleep_until(worker.now() + std::chrono::milliseconds(1));
      }
      const auto latest = edge.latest(1);
      if (!latest.empty())
        offload_.mapping().updates().send(worker, {}, {kMeanwhile}, latest, false);
    });
  }
  std::shared_ptr<const Map> map() const override { return offload_.map(); }

 private:
  EdgeNode& node_;
  OffloadEdge offload_;
};

TEST(EdgeLoops, AMapSentWhileALoopIsBeingClosedIsOneFromBefore) {
  System system = edgeslam_system();
  system.edge = [](EdgeNode& node, const Parameters& parameters) {
    return std::make_unique<SendsWhileClosing>(node, parameters);
  };
  // The global bundle takes minutes: it corrects nothing, and the end does not wait for it.
  const PairResult result = two_laps(system, true, 60e6);
  const auto closed = result.of("loop_closed");
  ASSERT_FALSE(closed.empty());
  const auto sent = result.of("update_sent");
  const auto meanwhile = std::find_if(sent.begin(), sent.end(), [](const auto& update) {
    return update["newest_keyframe"] == kMeanwhile;
  });
  ASSERT_NE(meanwhile, sent.end());
  EXPECT_LT((*meanwhile)["t_ns"], closed.front()["t_ns"]);
  const auto applied = result.of("update_applied");
  ASSERT_TRUE(std::any_of(applied.begin(), applied.end(), [&](const auto& update) {
    return update["update"] == (*meanwhile)["update"];
  }));
  EXPECT_GT(expect_all_in_place(result), 3);
  EXPECT_EQ(result.end_reason, "bye");
  EXPECT_TRUE(result.of("warning").empty());
  EXPECT_EQ(result.mobile_counts.keyframes, result.edge_counts.keyframes);
}

}  // namespace
}  // namespace slambed
