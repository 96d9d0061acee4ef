// SPDX-License-Identifier: Apache-2.0
#include "link/direction.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "base/error.hpp"

namespace slambed::link {
namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kSecond = 1000 * kMs;

DirectionOptions delays(std::vector<std::int64_t> delays_ns) {
  DirectionOptions options;
  options.delays_ns = std::move(delays_ns);
  return options;
}

TEST(DelaySchedule, InterpolatesBetweenStepsAndHoldsOutside) {
  const DelaySchedule linear({10 * kMs, 20 * kMs, 0}, 10 * kMs, Interpolation::kLinear);
  EXPECT_EQ(linear.at(-5 * kSecond), 10 * kMs);
  EXPECT_EQ(linear.at(0), 10 * kMs);
  EXPECT_EQ(linear.at(5 * kMs), 15 * kMs);
  EXPECT_EQ(linear.at(15 * kMs), 10 * kMs);
  EXPECT_EQ(linear.at(20 * kMs), 0);
  EXPECT_EQ(linear.at(kSecond), 0);
}

TEST(DelaySchedule, StepsHoldTheirValue) {
  const DelaySchedule stepped({10 * kMs, 20 * kMs}, 10 * kMs, Interpolation::kStep);
  EXPECT_EQ(stepped.at(10 * kMs - 1), 10 * kMs);
  EXPECT_EQ(stepped.at(10 * kMs), 20 * kMs);
}

TEST(DelaySchedule, RefusesAnEmptyTable) {
  EXPECT_THROW(DelaySchedule({}, kMs, Interpolation::kLinear), Error);
}

TEST(Direction, AddsNothingUntilTheProfileIsApplied) {
  DirectionModel model(delays({40 * kMs}), 1, 0);
  EXPECT_EQ(model.admit(kSecond, 100).due_ns, kSecond);
  model.apply_profile();
  EXPECT_EQ(model.admit(2 * kSecond, 100).due_ns, 2 * kSecond + 40 * kMs);
}

TEST(Direction, TheProfileAtZeroHoldsUntilItsStart) {
  DirectionModel model(delays({40 * kMs, 50 * kMs}), 1, 0);
  model.start(10 * kSecond);
  EXPECT_EQ(model.admit(5 * kSecond, 100).due_ns, 5 * kSecond + 40 * kMs);
  EXPECT_EQ(model.admit(10 * kSecond + 5 * kMs, 100).due_ns, 10 * kSecond + 50 * kMs);
}

TEST(Direction, NeverReordersWhenTheDelayFalls) {
  DirectionModel model(delays({40 * kMs, 0}), 1, 0);  // 40 ms less within 10 ms
  model.start(0);
  std::int64_t last = 0;
  for (std::int64_t now = 0; now < 60 * kMs; now += kMs / 10) {
    const std::int64_t due = model.admit(now, 1500).due_ns;
    ASSERT_GE(due, last) << "at " << now;
    ASSERT_GE(due, now);
    last = due;
  }
}

TEST(Direction, PacketsInAGapWaitForItsEnd) {
  DirectionOptions options = delays({10 * kMs});
  options.gaps = {{kSecond, kSecond + 300 * kMs}};
  DirectionModel model(options, 1, 0);
  model.start(0);
  EXPECT_EQ(model.admit(900 * kMs, 100).due_ns, 910 * kMs);
  EXPECT_EQ(model.admit(995 * kMs, 100).due_ns, 1300 * kMs);  // would arrive in the gap
  EXPECT_EQ(model.admit(1200 * kMs, 100).due_ns, 1300 * kMs);
  EXPECT_EQ(model.admit(1295 * kMs, 100).due_ns, 1305 * kMs);
}

TEST(Direction, PacketsWaitForTheEndOfOverlappingGaps) {
  DirectionOptions options = delays({10 * kMs});
  options.gaps = {{kSecond, kSecond + 300 * kMs}, {kSecond + 200 * kMs, kSecond + 500 * kMs}};
  DirectionModel model(options, 1, 0);
  model.start(0);
  EXPECT_EQ(model.admit(995 * kMs, 100).due_ns, 1500 * kMs);
}

TEST(Direction, AGapCanDropInstead) {
  DirectionOptions options = delays({10 * kMs});
  options.gaps = {{kSecond, kSecond + 300 * kMs}};
  options.gap_drops = true;
  DirectionModel model(options, 1, 0);
  model.start(0);
  EXPECT_EQ(model.admit(1100 * kMs, 100).fate, Fate::kInGap);
  EXPECT_EQ(model.admit(1400 * kMs, 100).fate, Fate::kDelivered);
}

TEST(Direction, AConstantRateSpacesPacketsAndDropsWhatTheQueueCannotHold) {
  DirectionOptions options = delays({0});
  options.rate = RateOptions{.bits_per_s = 12e6, .queue_bytes = 4500};  // 1,500 bytes in 1 ms
  DirectionModel model(options, 1, 0);
  model.start(0);
  EXPECT_EQ(model.admit(0, 1500).due_ns, kMs);
  EXPECT_EQ(model.admit(0, 1500).due_ns, 2 * kMs);
  EXPECT_EQ(model.admit(0, 1500).due_ns, 3 * kMs);
  EXPECT_EQ(model.admit(0, 1500).fate, Fate::kQueueFull);
  const PacketOutcome later = model.admit(kMs, 1500);  // the first one has left
  EXPECT_EQ(later.queue_bytes, 3000);
  EXPECT_EQ(later.due_ns, 4 * kMs);
}

TEST(Direction, ARateTraceGivesOnePacketPerOpportunityAndRepeats) {
  DirectionOptions options = delays({0});
  options.rate = RateOptions{.opportunities_ns = {2 * kMs, 5 * kMs, 10 * kMs},
                             .period_ns = 10 * kMs,
                             .queue_bytes = 100000};
  DirectionModel model(options, 1, 0);
  model.start(0);
  EXPECT_EQ(model.admit(0, 1500).due_ns, 2 * kMs);
  EXPECT_EQ(model.admit(0, 700).due_ns, 5 * kMs);
  EXPECT_EQ(model.admit(0, 700).due_ns, 5 * kMs);  // shares the previous packet's opportunity
  EXPECT_EQ(model.admit(0, 1500).due_ns,
            10 * kMs);  // only 100 bytes are left: also needs the next opportunity
  EXPECT_EQ(model.admit(13 * kMs, 1500).due_ns, 15 * kMs);  // the one at 12 ms was not used
}

TEST(Direction, ARateTraceBeginsAnewAtRunTimeZero) {
  DirectionOptions options = delays({0});
  options.rate = RateOptions{
      .opportunities_ns = {2 * kMs, 100 * kMs}, .period_ns = 100 * kMs, .queue_bytes = 100000};
  DirectionModel model(options, 1, 0);
  model.apply_profile();
  for (int i = 0; i < 20; ++i) model.admit(50 * kMs, 1500);  // uses up a second of the trace
  model.start(10 * kSecond);
  EXPECT_EQ(model.admit(10 * kSecond, 1500).due_ns, 10 * kSecond + 2 * kMs);
}

TEST(Direction, ARateTraceDeliversItsMeanRate) {
  DirectionOptions options = delays({0});
  RateOptions rate{.queue_bytes = 1'000'000};
  for (int ms = 3; ms <= 999; ms += 3) rate.opportunities_ns.push_back(ms * kMs);  // 333 a second
  rate.period_ns = 999 * kMs;
  options.rate = rate;
  DirectionModel model(options, 1, 0);
  model.start(0);
  std::int64_t bytes = 0;
  for (std::int64_t now = 0; now < 20 * kSecond; now += kMs) {
    const PacketOutcome outcome = model.admit(now, 1000);
    if (outcome.fate == Fate::kDelivered && outcome.due_ns <= 20 * kSecond) bytes += 1000;
  }
  const double expected = 20e9 / (3.0 * kMs) * 1500;
  EXPECT_NEAR(static_cast<double>(bytes), expected, 0.01 * expected);
}

std::vector<int> lost_numbers(const LossOptions& loss, std::uint64_t seed, int count, bool jitter) {
  DirectionOptions options = delays({0});
  options.loss = loss;
  if (jitter) options.jitter = JitterOptions{.scale_ns = 1.0 * kMs};
  DirectionModel model(options, seed, 0);
  model.start(0);
  std::vector<int> lost;
  for (int i = 0; i < count; ++i) {
    if (model.admit(i * kMs, 100).fate == Fate::kLost) lost.push_back(i);
  }
  return lost;
}

TEST(Direction, SameSeedSameDropsWhateverElseIsOn) {
  const LossOptions loss{.loss_good = 0.1};
  const auto first = lost_numbers(loss, 7, 1000, false);
  EXPECT_FALSE(first.empty());
  EXPECT_EQ(first, lost_numbers(loss, 7, 1000, false));
  EXPECT_EQ(first, lost_numbers(loss, 7, 1000, true));
  EXPECT_NE(first, lost_numbers(loss, 8, 1000, false));
}

TEST(Direction, DirectionsHaveTheirOwnLuck) {
  LossModel up({.loss_good = 0.5}, 3, 0);
  LossModel down({.loss_good = 0.5}, 3, 1);
  int same = 0;
  for (int i = 0; i < 1000; ++i) same += up.drop() == down.drop();
  EXPECT_NEAR(same, 500, 3 * std::sqrt(1000 * 0.25));
}

TEST(Direction, BurstsInTimeComeAndGoWhateverIsSent) {
  DirectionOptions options = delays({0});
  options.loss = LossOptions{.mean_good_ns = 2.0 * kSecond, .mean_bad_ns = 0.2 * kSecond};
  DirectionModel busy(options, 3, 0), idle(options, 3, 0);
  busy.start(0);
  idle.start(0);
  std::int64_t lost = 0, bursts = 0;
  bool before = false;
  constexpr std::int64_t kEnd = 2000 * kSecond;
  for (std::int64_t now = 0; now < kEnd; now += 5 * kMs) {
    const bool now_lost = busy.admit(now, 100).fate == Fate::kLost;
    if (now % (1500 * kMs) == 0) {  // few packets, yet the same bursts
      EXPECT_EQ(idle.admit(now, 100).fate == Fate::kLost, now_lost) << now;
    }
    lost += now_lost;
    bursts += now_lost && !before;
    before = now_lost;
  }
  // About 909 cycles of 2.2 s: 1 in 11 lost, each mean within three standard errors.
  const double share = static_cast<double>(lost) / (kEnd / (5 * kMs));
  EXPECT_NEAR(share, 1.0 / 11, 3 * 1.0 / 11 * std::sqrt(2.0 / 909));
  const double burst_ms = 5.0 * static_cast<double>(lost) / static_cast<double>(bursts);
  EXPECT_NEAR(burst_ms, 200, 3 * 200 / std::sqrt(909.0));
}

TEST(Direction, BurstsInTimeAreThoseOfTheHarness) {
  // The harness switches backend netem at these times; test_link_bursts.py has the same numbers.
  constexpr std::int64_t kTurns_ns[2][6] = {
      {80'247'019, 180'761'820, 1'320'400'379, 1'457'263'917, 1'673'072'515, 1'851'620'767},
      {889'268'368, 1'483'319'504, 4'201'529'243, 4'355'098'889, 6'842'238'566, 7'003'469'677}};
  for (const std::uint64_t direction : {0u, 1u}) {
    LossModel model({.mean_good_ns = 2.0 * kSecond, .mean_bad_ns = 0.2 * kSecond}, 3, direction);
    bool lost = false;
    for (const std::int64_t turn_ns : kTurns_ns[direction]) {
      EXPECT_EQ(model.drop(turn_ns - 2), lost) << turn_ns;
      lost = !lost;
      EXPECT_EQ(model.drop(turn_ns + 2), lost) << turn_ns;
    }
  }
}

TEST(Direction, BurstsInTimeBeginWithTheRun) {
  DirectionOptions options = delays({0});
  options.loss = LossOptions{.mean_good_ns = 1e-6, .mean_bad_ns = 1e18};
  DirectionModel model(options, 1, 0);
  model.apply_profile();
  EXPECT_EQ(model.admit(0, 100).fate, Fate::kDelivered);
  model.start(kSecond);
  EXPECT_EQ(model.admit(kSecond / 2, 100).fate, Fate::kDelivered);
  EXPECT_EQ(model.admit(kSecond, 100).fate, Fate::kLost);
}

TEST(Direction, AProbeChangesNothingForTheData) {
  DirectionOptions options = delays({3 * kMs});
  options.loss = LossOptions{.to_bad = 0.05, .to_good = 0.3};
  options.jitter = JitterOptions{.scale_ns = 2.0 * kMs};
  options.rate = RateOptions{.bits_per_s = 12e6, .queue_bytes = 6000};
  DirectionModel plain(options, 9, 0), probed(options, 9, 0);
  plain.start(0);
  probed.start(0);
  int answered = 0, waited = 0;
  for (std::int64_t now = 0; now < 20 * kSecond; now += 2 * kMs) {
    const PacketOutcome probe = probed.admit(now, 76, Lane::kProbe);
    EXPECT_NE(probe.fate, Fate::kQueueFull);
    answered += probe.fate == Fate::kDelivered;
    const int packets = now / kSecond % 2 == 0 ? 3 : 0;  // 18 Mbit/s, and nothing
    for (int i = 0; i < packets; ++i) {
      const PacketOutcome a = plain.admit(now, 1500), b = probed.admit(now, 1500);
      ASSERT_EQ(a.fate, b.fate) << now;
      ASSERT_EQ(a.due_ns, b.due_ns) << now;
    }
    // Behind a full queue a probe waits 4 ms, as a data packet would.
    if (packets > 0 && probe.fate == Fate::kDelivered) waited += probe.due_ns - now > 5 * kMs;
  }
  EXPECT_GT(answered, 7000);
  EXPECT_GT(waited, 2000);
}

}  // namespace
}  // namespace slambed::link
