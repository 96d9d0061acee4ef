// SPDX-License-Identifier: Apache-2.0
// An edge that starts with a stored map, and a mobile that starts in it.
#include <gtest/gtest.h>

#include "base/error.hpp"
#include "edgeslam/tests/edgeslam_runs.hpp"
#include "offload/tests/prior_trip.hpp"

namespace slambed {
namespace {

namespace runs = testing::edgeslam;
using testing::PairLink;
using testing::PairResult;
using testing::PriorTrip;

const PriorTrip& turn_before() {
  static const PriorTrip prior(runs::run(runs::conventional()).edge_map);
  return prior;
}

nlohmann::json params(const std::string& map) {
  auto all = runs::conventional();
  all["prior_map"] = map;
  return all;
}

TEST(EdgeSlamPriorMap, AMobileIsFoundInTheMapThatTheEdgeBeganWith) {
  const PairResult result = runs::run(params(turn_before().map()), 120, 0.1, testing::later_trip);
  testing::expect_found_in(turn_before(), result);
  // The mobile got a part of the stored map, which the edge never cleared.
  EXPECT_LT(result.mobile_map.keyframes.size(), turn_before().keyframes);
  EXPECT_FALSE(result.of("update_applied").empty());
}

TEST(EdgeSlamPriorMap, UntilTheEdgeAnswersTheMobileMakesNoMap) {
  PairLink deaf;
  deaf.lossy_channel = "frame";
  deaf.lost = 1000;
  const PairResult result = testing::run_pair(edgeslam_system(), params(turn_before().map()), 30,
                                              10, deaf, testing::later_trip);
  EXPECT_TRUE(result.of("keyframe_created").empty());
  EXPECT_EQ(result.of("frame_tracked").back()["state"], "lost");
  EXPECT_EQ(result.edge_map.keyframes.size(), turn_before().keyframes);
}

TEST(EdgeSlamPriorMap, OneThatIsMissingOrOfAnotherCameraIsRefused) {
  for (const std::string& map :
       {turn_before().of_another_camera(), turn_before().map() + ".not_there"})
    EXPECT_THROW(runs::run(params(map), 10), Error) << map;
}

}  // namespace
}  // namespace slambed
