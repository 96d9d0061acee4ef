// SPDX-License-Identifier: Apache-2.0
// Invalid answers to a lost camera, and hundreds of losses.
#include <gtest/gtest.h>
#include <malloc.h>

#include <algorithm>
#include <limits>

#include "multithread_rl/tests/lost_turn.hpp"
#include "wire/reloc_messages.hpp"

namespace slambed {
namespace {

using testing::kDark;
using testing::kDarkFor;
using testing::lost_turn;
using testing::lost_turn_params;
using testing::PairLink;
using testing::PairResult;
using testing::pose_at;
using testing::SyntheticScene;

bool is_found(const Message& message) {
  return message.type == wire::type_of(wire::RelocOk::kType);
}

wire::RelocOk read(const Message& message) {
  static const SyntheticScene kWorld;
  return wire::decode_reloc_ok(message.payload, kWorld.sensor());
}

void name_a_point_that_is_not_there(Message& message) {
  wire::RelocOk found = read(message);
  const MapPointId first = found.matches.front().second;
  std::erase_if(found.keyframe.points, [&](const NewPoint& point) { return point.id == first; });
  for (MapPointId& id : found.keyframe.keyframes.front().points)
    if (id == first) id = {};
  message.payload = encode(found);
}

void be_infinitely_far(Message& message) {
  wire::RelocOk found = read(message);
  found.T_cw.t.x() = std::numeric_limits<double>::infinity();
  message.payload = encode(found);
}

void answer_what_was_never_asked(Message& message) {
  wire::RelocOk found = read(message);
  found.number += 1000;
  message.payload = encode(found);
}

void match_a_feature_beyond_the_frame(Message& message) {
  wire::RelocOk found = read(message);
  found.matches.back().first = std::numeric_limits<std::uint16_t>::max();
  message.payload = encode(found);
}

void be_noise(Message& message) {
  std::mt19937 random(3);
  message.payload.resize(75'000);
  for (auto& byte : message.payload) byte = static_cast<std::uint8_t>(random());
}

struct BadAnswer {
  const char* name;
  void (*spoil)(Message&);
  const char* reported;
};

void PrintTo(const BadAnswer& bad, std::ostream* out) { *out << bad.name; }

class BadAnswers : public ::testing::TestWithParam<BadAnswer> {};

/// Only the edge could relocalize this camera, and all its answers are corrupted in transit. Each
/// is logged in one line, and none of its poses or points reaches the map.
TEST_P(BadAnswers, AreToldInOneLineEachAndChangeNothing) {
  int spoilt = 0;
  PairLink link;
  link.alter_frames = [&](Message& message) {
    if (is_found(message)) {
      GetParam().spoil(message);
      ++spoilt;
    }
    return true;
  };
  const PairResult result = lost_turn(lost_turn_params("staged"), link);
  ASSERT_GT(spoilt, 0);
  int reported = 0;
  for (const auto& event : result.mobile) {
    for (const char* field : {"reason", "text"}) {
      if (!event.contains(field) || !event[field].is_string()) continue;
      reported += event[field].get<std::string>().find(GetParam().reported) != std::string::npos;
    }
  }
  EXPECT_EQ(reported, spoilt);
  EXPECT_TRUE(result.of("relocalized").empty());
  EXPECT_EQ(result.of("frame_tracked").back()["state"], "lost");
  EXPECT_EQ(result.end_reason, "bye");
  for (const NewKeyFrame& keyframe : result.mobile_map.keyframes) {
    EXPECT_LT(keyframe.frame_index, static_cast<std::uint64_t>(kDark));
    EXPECT_TRUE(keyframe.T_cw.t.allFinite());
  }
}

INSTANTIATE_TEST_SUITE_P(
    Table, BadAnswers,
    ::testing::Values(BadAnswer{"UnknownPoint", name_a_point_that_is_not_there, "refused"},
                      BadAnswer{"InfinitePose", be_infinitely_far, "refused"},
                      BadAnswer{"NeverAsked", answer_what_was_never_asked, "not asked for"},
                      BadAnswer{"FeatureBeyondTheFrame", match_a_feature_beyond_the_frame,
                                "not of the frame"},
                      BadAnswer{"Noise", be_noise, "refused"}),
    [](const auto& bad) { return bad.param.name; });

/// Bytes that the process has allocated and not freed.
std::size_t memory_in_use() {
  const auto info = mallinfo2();
  return info.uordblks + info.hblkhd;
}

/// A camera that turns once and then alternates between two parts of the turn, with darkness in
/// between. Or it stays in one of them.
constexpr int kLosses = 200, kSeen = 12, kCovered = 3, kCycle = kSeen + kCovered;

std::shared_ptr<const FeatureSet> to_and_fro(SyntheticScene& scene, int frame, bool covered) {
  if (frame < kDark) return testing::turn(scene, frame);
  const int cycle = (frame - kDark) / kCycle, step = (frame - kDark) % kCycle;
  if (covered && step < kCovered) return scene.nothing();
  const int part = covered && cycle % 2 ? 15 : 55;
  return scene.look(pose_at(part + std::min(step, kCycle - step) * 2.0));
}

struct LongRun {
  PairResult result;
  std::vector<std::size_t> in_use;  ///< at the start of each cycle
  double growth(int from, int to) const {
    return static_cast<double>(in_use[to]) - static_cast<double>(in_use[from]);
  }
};

LongRun long_run(bool covered) {
  LongRun run;
  run.result = lost_turn(
      lost_turn_params("staged"), {.one_way_ms = {5}},
      [&](SyntheticScene& scene, int frame) {
        if (frame >= kDark && (frame - kDark) % kCycle == 0) run.in_use.push_back(memory_in_use());
        return to_and_fro(scene, frame, covered);
      },
      kDark + kLosses * kCycle);
  return run;
}

TEST(EdgeRelocalizationForLong, TwoHundredLossesLeaveNothingBehind) {
  const LongRun losing = long_run(true), staying = long_run(false);
  const PairResult& result = losing.result;
  EXPECT_TRUE(staying.result.of("track_lost").empty());
  for (const char* event : {"track_lost", "suspended", "resumed", "relocalized"})
    EXPECT_EQ(result.of(event).size(), static_cast<std::size_t>(kLosses)) << event;
  EXPECT_EQ(result.of("frame_tracked").back()["state"], "ok");
  EXPECT_EQ(result.end_reason, "bye");
  EXPECT_GE(result.of("reloc_request").size(), static_cast<std::size_t>(kLosses));
  EXPECT_LE(result.mobile_counts.keyframes, 30u);
  // The logs grow with the frames. A loss that leaked its request would leak 1,000 features.
  constexpr int kFrom = 50, kTo = kLosses - 1;
  constexpr double kOfALoss_bytes = 10e3;
  EXPECT_LT(losing.growth(kFrom, kTo), staying.growth(kFrom, kTo) + (kTo - kFrom) * kOfALoss_bytes);
}

}  // namespace
}  // namespace slambed
