// SPDX-License-Identifier: Apache-2.0
// DynNetSLAM's sources of the RTT, and what it does when there is no RTT any more.
#include "base/error.hpp"
#include "dynnetslam/tests/switching_pair.hpp"

namespace slambed::testing {
namespace {

TEST_P(DynNetSlam, AWayThatIsCutLeadsToTheMobileSideAndBack) {
  PairLink link;
  link.one_way_ms = {5};
  link.gaps = {{8'000'000'000, 13'000'000'000}};
  for (const bool safe_zone : {false, true}) {
    const PairResult result = run(params(true, safe_zone), 300, link);
    EXPECT_EQ(states(result), safe_zone ? "OS SZ MES SZ OS" : "OS MES OS");
    expect_all_tracked(result, 300);
    expect_consistent(result.edge_map);
    expect_no_stale_update(result);
  }
}

TEST_P(DynNetSlam, TheEchoServesAsRttToo) {
  auto parameters = params(true, false);
  parameters["rtt_source"] = "echo";
  parameters["echo_hz"] = 10.0;
  const PairResult result = run(parameters, 420, ramp(60, 20));
  EXPECT_EQ(states(result), "OS MES OS");
  expect_all_tracked(result, 420);
}

TEST_P(DynNetSlam, TheProfileServesAsRttWhateverThePathDoes) {
  auto parameters = params(true, true);
  parameters["rtt_source"] = "profile";
  PairLink link;
  link.one_way_ms = {1};
  const PairLink asked = ramp(60, 20);
  link.profile_rtt = RttTable{.step = std::chrono::milliseconds(100), .values = {}};
  for (const double ms : asked.one_way_ms)
    link.profile_rtt->values.push_back(from_seconds(2 * ms / 1000));
  const PairResult result = run(parameters, 420, link);
  EXPECT_EQ(states(result), "OS SZ MES SZ OS");
  expect_all_tracked(result, 420);
  for (const auto& event : result.of("state_changed")) {
    const RunTime when(event["t_ns"].get<std::int64_t>());
    EXPECT_NEAR(event["rtt_ms"].get<double>(), to_ms(link.profile_rtt->at(when)), 0.05);
  }
  link.profile_rtt.reset();
  EXPECT_THROW(run(parameters, 10, link), Error);
}

TEST_P(DynNetSlam, AProfileDoesNotHideALostEdge) {
  auto parameters = params(true, false);
  parameters["rtt_source"] = "profile";
  PairLink link;
  link.one_way_ms = {5};
  link.gaps = {{8'000'000'000, 13'000'000'000}};
  link.profile_rtt = RttTable{.step = std::chrono::seconds(1), .values = {from_seconds(0.01)}};
  const PairResult result = run(parameters, 300, link);
  EXPECT_EQ(states(result), "OS MES OS");
  expect_all_tracked(result, 300);
}

}  // namespace
}  // namespace slambed::testing
