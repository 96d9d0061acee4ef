// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "apps/pace/busy.hpp"
#include "apps/pace/workload.hpp"

namespace slambed::pace {
namespace {

TEST(Workload, EqualUnitsGiveEqualChecksums) {
  Workload first;
  Workload second;
  for (int i = 0; i < 100; ++i) first.unit();
  for (int i = 0; i < 99; ++i) second.unit();
  EXPECT_NE(first.checksum(), second.checksum());
  second.unit();
  EXPECT_EQ(first.checksum(), second.checksum());
}

/// Guards the unit of speed: a change of this checksum invalidates every calibrated speed.
TEST(Workload, IsTheSameWorkAsEver) {
  Workload work;
  for (int i = 0; i < 100; ++i) work.unit();
  EXPECT_EQ(work.checksum(), 41153027U);
}

TEST(Busy, EveryThreadReportsTheSameWork) {
  const BusyOptions options{.threads = 3, .seconds = 0.05, .settle_s = 0.0};
  const auto threads = measure_busy(options);
  ASSERT_EQ(threads.size(), 3U);
  for (const auto& thread : threads) {
    EXPECT_EQ(thread.checksum, threads.front().checksum);
    EXPECT_GT(thread.units_per_s, 0.0);
    EXPECT_GE(thread.units_per_cpu_s, thread.units_per_s * 0.99);
    EXPECT_GT(thread.longest_freeze_ms, 0.0);
  }
  const auto json = nlohmann::json::parse(busy_json(options, threads));
  EXPECT_EQ(json["workload"], 1);
  EXPECT_EQ(json["threads"].size(), 3U);
  EXPECT_EQ(json["threads"][0]["checksum"], threads.front().checksum);
}

}  // namespace
}  // namespace slambed::pace
