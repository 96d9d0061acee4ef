// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "dynnetslam/dynnetslam.hpp"
#include "node/tests/fitted_device.hpp"
#include "node/tests/virtual_pair.hpp"
#include "offload/tests/turning_pair.hpp"

namespace slambed::testing {

inline constexpr double kFps = 10;
/// Largest allowed distance of a keyframe of either map from the camera's true position.
inline constexpr double kPositionTolerance_m = 0.02;

inline nlohmann::json params(bool hysteresis, bool safe_zone) {
  auto params = enhanced();
  params.update({{"sync_period_s", 1.0},
                 {"fast_motion_ms", 0.0},
                 {"loop_closing", false},
                 {"hysteresis", hysteresis},
                 {"safe_zone", safe_zone},
                 {"l_ol_ms", 40.0},
                 {"l_sz_ms", -1.0},
                 {"b_ms", 10.0},
                 {"rtt_source", "tcp_info"},
                 {"mes_probe_hz", 10.0},
                 {"mes_probe_bytes", 64},
                 {"echo_hz", 4.0},
                 {"rtt_missing_s", 2.0},
                 {"decision_gap_s", 2.0}});
  return params;
}

/// Makes a link from pairs of an RTT in ms and its duration in s.
inline PairLink steps(const std::vector<std::pair<double, double>>& rtts) {
  PairLink link{.one_way_ms = {}, .step_s = 0.1};
  for (const auto& [rtt_ms, seconds] : rtts)
    link.one_way_ms.insert(link.one_way_ms.end(), static_cast<std::size_t>(seconds * 10),
                           rtt_ms / 2);
  return link;
}

/// Makes a link whose RTT rises linearly to the peak and falls again.
inline PairLink ramp(double peak_rtt_ms, double half_s) {
  PairLink link{.one_way_ms = {}, .step_s = 0.1};
  const int half = static_cast<int>(half_s * 10);
  for (int i = 0; i <= 2 * half; ++i)
    link.one_way_ms.push_back(peak_rtt_ms / 2 * (1 - std::abs(i - half) / double(half)));
  return link;
}

inline std::string states(const PairResult& result) {
  std::string text;
  for (const auto& event : result.of("state_changed")) {
    if (!text.empty()) text += ' ';
    text += event["to"].get<std::string>();
  }
  return text;
}

inline void expect_all_tracked(const PairResult& result, int frames) {
  EXPECT_TRUE(result.finished);
  EXPECT_EQ(result.of("frame_tracked").size() + result.of("frame_dropped").size(),
            static_cast<std::size_t>(frames));
  EXPECT_TRUE(result.of("track_lost").empty());
  EXPECT_TRUE(result.of("warning").empty());
}

/// Expects keyframes at the camera's true positions, observations of existing points only, and no
/// point without observations.
inline void expect_consistent(const MapDelta& map, double speed) {
  std::set<MapPointId> points, seen;
  for (const NewPoint& point : map.points) points.insert(point.id);
  for (const NewKeyFrame& keyframe : map.keyframes) {
    const SE3 truth =
        pose_at(speed * static_cast<double>(keyframe.frame_index)) * pose_at(0).inverse();
    const Eigen::Vector3d error = keyframe.T_cw.inverse().t - truth.inverse().t;
    EXPECT_LT(error.norm(), kPositionTolerance_m) << "frame " << keyframe.frame_index;
    for (const MapPointId id : keyframe.points) {
      if (!id) continue;
      EXPECT_TRUE(points.contains(id));
      seen.insert(id);
    }
  }
  EXPECT_EQ(seen.size(), points.size());
}

/// Expects that no map of an older epoch was applied (times in ns). Needs a run with updates.
inline void expect_no_stale_update(const PairResult& result) {
  std::map<std::uint64_t, double> epoch_ends;  // when epoch n was over
  for (const auto& event : result.of("state_changed")) {
    if (event["to"] == "MES") epoch_ends[event["epoch"].get<std::uint64_t>() - 1] = event["t_ns"];
  }
  std::map<std::uint64_t, std::uint64_t> epoch_of;
  for (const auto& event : result.of("update_sent"))
    epoch_of[event["update"].get<std::uint64_t>()] = event["epoch"].get<std::uint64_t>();
  EXPECT_FALSE(epoch_ends.empty());
  EXPECT_FALSE(result.of("update_applied").empty());
  int compared = 0;
  for (const auto& event : result.of("update_applied")) {
    const auto end = epoch_ends.find(epoch_of.at(event["update"].get<std::uint64_t>()));
    if (end != epoch_ends.end()) {
      EXPECT_LE(event["t_ns"].get<double>(), end->second);
      ++compared;
    }
  }
  EXPECT_GT(compared, 0) << "no update of an epoch that ended was applied: nothing was compared";
}

/// Counts keyframes mapped on a node in this state, from a second after it began.
inline int mapped_in(const PairResult& result, const std::vector<nlohmann::json>& side,
                     const std::string& state) {
  const auto changes = result.of("state_changed");
  int mapped = 0;
  for (const auto& event : side) {
    if (event["type"] != "keyframe_mapped") continue;
    std::string now;
    for (const auto& change : changes)
      if (change["t_ns"].get<double>() + 1e9 < event["t_ns"].get<double>())
        now = change["to"];
      else if (change["t_ns"].get<double>() < event["t_ns"].get<double>())
        now = "just changed";
    mapped += now == state ? 1 : 0;
  }
  return mapped;
}

/// kUniform: all stages cost the same, whatever their size. kFitted: devices fitted to the paper,
/// over a link on which a map takes long.
enum class World { kUniform, kFitted };

class DynNetSlam : public ::testing::TestWithParam<World> {
 protected:
  static bool fitted() { return GetParam() == World::kFitted; }
  /// A keyframe takes 32 ms at 10 Mbit/s, which adds to the RTT, so limits and latencies are
  /// further apart there.
  static double wider() { return fitted() ? 5 : 1; }
  /// The fitted board needs a second for each keyframe.
  static double speed() { return fitted() ? 0.5 : 1; }
  static void expect_consistent(const MapDelta& map) { testing::expect_consistent(map, speed()); }
  static nlohmann::json params(bool hysteresis, bool safe_zone) {
    auto wide = testing::params(hysteresis, safe_zone);
    wide.update({{"l_ol_ms", 40 * wider()}, {"b_ms", 10 * wider()}});
    return wide;
  }
  static PairLink steps(std::vector<std::pair<double, double>> rtts) {
    for (auto& [rtt_ms, seconds] : rtts) rtt_ms *= wider();
    return testing::steps(rtts);
  }
  static PairLink ramp(double peak_rtt_ms, double half_s) {
    return testing::ramp(peak_rtt_ms * wider(), half_s);
  }
  static PairResult run(const nlohmann::json& parameters, int frames, PairLink link,
                        testing::SceneSource::Look look = {}) {
    if (!look) {
      look = [](SyntheticScene& scene, int frame) { return scene.look(pose_at(speed() * frame)); };
    }
    if (fitted()) {
      link.mbit_per_s = 10;
      link.mobile_device = testing::fitted_device(SLAMBED_DEVICES, "raspberry_pi_4");
      link.edge_device = testing::fitted_device(SLAMBED_DEVICES, "edge_i7_6700t");
    }
    return testing::run_pair(dynnetslam_system(), parameters, frames, kFps, link, std::move(look));
  }
};

}  // namespace slambed::testing
