// SPDX-License-Identifier: Apache-2.0
// The mobile does not wait for answers after a failed segmentation or an unreadable upload.
#include <gtest/gtest.h>

#include "edgeslam_semantic/tests/semantic_pair.hpp"

namespace slambed {
namespace {

class NoMask : public SemanticPair {
 protected:
  static nlohmann::json edgeslam(bool adapt) {
    nlohmann::json chosen = params();
    chosen["full_offload"] = false;
    chosen["nrcc"] = true;
    chosen["adapt"] = adapt;
    return chosen;
  }
  static FrameMasks nobody() { return {kWidth, kHeight, {}}; }
};

TEST_F(NoMask, TheNextKeyFrameGoesUpAsIfItHadCome) {
  const Played whole = play_pair(edgeslam(false), [](auto) { return nobody(); });
  const Played run = play_pair(edgeslam(false), [](auto) { return std::nullopt; });
  const auto sent = whole.of("keyframe_sent").size();
  ASSERT_GT(sent, 10u);
  EXPECT_TRUE(whole.of("mask_missing").empty());
  EXPECT_GE(run.of("keyframe_sent").size(), sent - 1);
  EXPECT_TRUE(run.of("mask_applied").empty());
  const auto missing = run.of("mask_missing"), failed = run.of("segment_failed");
  EXPECT_LE(failed.size(), missing.size() + 1) << "the last one may come behind the BYE";
  for (const auto& one : missing) {
    EXPECT_EQ(one["reason"], "not segmented");
    EXPECT_GE(one["nrcc_ms"], kSegment_ms);
  }
  EXPECT_GT(run.of("slice_applied").size(), 5u) << "mapping goes on";
}

TEST_F(NoMask, AdaptiveSelectionIsNotHeldUpEither) {
  const auto play_with = [&](std::uint64_t until) {
    return play_pair(edgeslam(true), [=](std::uint64_t frame) {
      return frame < until ? std::optional(nobody()) : std::nullopt;
    });
  };
  const Played whole = play_with(kFrames), run = play_with(kFrames / 3);
  ASSERT_GT(whole.of("mask_applied").size(), run.of("mask_applied").size());
  EXPECT_GT(run.of("mask_applied").size(), 0u);
  const auto last = [](const Played& played) {
    return played.of("keyframe_sent").back()["t_ns"].get<double>() / 1e9;
  };
  EXPECT_GE(run.of("keyframe_sent").size() + 2, whole.of("keyframe_sent").size());
  EXPECT_GT(last(run), last(whole) - 1);
}

TEST_F(NoMask, AnUploadThatCannotBeReadIsNotWaitedFor) {
  constexpr int kTorn = 5;
  const auto answer = [](auto) { return nobody(); };
  const Played whole = play_pair(edgeslam(false), answer);
  const Played run = play_pair(edgeslam(false), answer, {.torn_upload = kTorn});
  ASSERT_GT(whole.of("keyframe_sent").size(), 10u);
  EXPECT_GE(run.of("keyframe_sent").size() + 1, whole.of("keyframe_sent").size());
  const auto refused = run.of("keyframe_refused");
  ASSERT_EQ(refused.size(), 1u);
  EXPECT_EQ(refused[0]["keyframe"], run.of("keyframe_sent")[kTorn - 1]["keyframe"]);
  const auto warnings = run.of("warning");
  EXPECT_EQ(std::count_if(warnings.begin(), warnings.end(),
                          [](const auto& one) {
                            return one["text"].template get<std::string>().find(
                                       "SEMANTIC_KEYFRAME refused") == 0;
                          }),
            1);
}

/// Without a map's first upload the edge declines all later ones.
TEST_F(NoMask, WhereTheFirstUploadCannotBeReadTheMapBeginsAnew) {
  for (const bool adapt : {true, false}) {
    const Played run =
        play_pair(edgeslam(adapt), [](auto) { return nobody(); }, {.torn_upload = 1});
    const auto refused = run.of("keyframe_refused");
    ASSERT_EQ(refused.size(), 1u) << adapt;
    const auto sent = run.of("keyframe_sent");
    const auto again = std::find_if(sent.begin(), sent.end(),
                                    [](const auto& one) { return one["reason"] == "refused"; });
    ASSERT_NE(again, sent.end()) << adapt;
    EXPECT_GT((*again)["new_points"], 50) << "of the whole local map";
    EXPECT_EQ(std::count_if(again, sent.end(),
                            [](const auto& one) { return one["reason"] == "refused"; }),
              1);
    EXPECT_EQ(run.of("keyframe_declined").empty(), !adapt);
    for (const auto& declined : run.of("keyframe_declined"))
      EXPECT_LT(declined["keyframe"], (*again)["keyframe"]) << adapt;
    EXPECT_GT(run.of("slice_applied").size(), 5u) << adapt;
    EXPECT_GT(run.of("mask_applied").size(), 5u) << adapt;
    EXPECT_TRUE(run.of("edge_restarted").empty());
  }
}

}  // namespace
}  // namespace slambed
