// SPDX-License-Identifier: Apache-2.0
// The edge's stored map with updates that are prepared in parallel to tracking.
#include <gtest/gtest.h>

#include "base/error.hpp"
#include "multithread_rl/tests/lost_turn.hpp"
#include "offload/tests/prior_trip.hpp"

namespace slambed::testing {
namespace {

nlohmann::json params(const std::string& relocalization) {
  auto all = lost_turn_params("staged");
  all.update({{"relocalization", relocalization}, {"n_kf", 6}});
  return all;
}

TEST(MultithreadPriorMap, AMobileIsFoundInItUnlessPosesAreAskedFor) {
  const PriorTrip prior(lost_turn(params("map"), {}, turn, 120).edge_map);
  auto later = params("map");
  later["prior_map"] = prior.map();
  expect_found_in(prior, lost_turn(later, {}, later_trip));
  later["relocalization"] = "edge";
  EXPECT_THROW(lost_turn(later, {}, later_trip), Error);
}

}  // namespace
}  // namespace slambed::testing
