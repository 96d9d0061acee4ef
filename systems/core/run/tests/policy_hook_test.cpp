// SPDX-License-Identifier: Apache-2.0
// A policy sees a frame before tracking does, and may remove features from it.
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "base/error.hpp"
#include "base/tests/temporary_folder.hpp"
#include "node/mobile_node.hpp"
#include "run/node_files.hpp"
#include "run/virtual_run.hpp"
#include "synth/generator.hpp"

namespace slambed {
namespace {

constexpr int kWidth = 320, kHeight = 240, kDark = 10;

/// What the policy saw, and what tracking saw after it.
struct Seen {
  int frames = 0, pictures = 0, fine = 0, lost = 0;
  std::vector<int> given, tracked;
};

/// Lets tracking see no feature above octave 3, and none at all in frame kDark.
class CullingPolicy final : public MobilePolicy {
 public:
  CullingPolicy(MobileNode& node, Seen& seen) : node_(node), seen_(seen) {}

  std::shared_ptr<const FeatureSet> before_tracking(
      Worker&, const OfferedFrame& frame, std::shared_ptr<const FeatureSet> features) override {
    const auto picture = node_.picture(frame);
    seen_.pictures +=
        picture && picture->index == frame.played.index && picture->gray.width == kWidth;
    std::vector<std::uint8_t> keep(features->keypoints().size());
    for (int i = 0; i < features->size(); ++i)
      keep[i] = frame.played.index != kDark && features->keypoint(i).octave <= 3;
    auto kept = select(*features, keep);
    seen_.given.push_back(kept->size());
    seen_.fine += kept->size() < features->size();
    return kept;
  }
  void after_frame(Worker&, const TrackedFrame& frame) override {
    ++seen_.frames;
    seen_.tracked.push_back(frame.features->size());
    seen_.lost += frame.outcome.state == TrackingState::kLost;
    if (node_.tracker().wants_keyframe({})) node_.tracker().create_keyframe();
  }
  void finish(Worker&) override {}
  void place_keyframes(PoseBook&) override {}
  MapCounts counts() const override { return count(*node_.tracker().map()); }

 private:
  MobileNode& node_;
  Seen& seen_;
};

System culling_system(Seen& seen) {
  System system;
  system.name = "culling";
  system.orb = [](const Parameters&) { return OrbOptions{.features = 600}; };
  system.tracker = [](const Parameters&) {
    return TrackerOptions{.min_init_features = 100, .reset_below_keyframes = 0};
  };
  system.sequential = [](const Parameters&) { return true; };
  system.mobile = [&seen](MobileNode& node, const Parameters&) {
    return std::make_unique<CullingPolicy>(node, seen);
  };
  return system;
}

TEST(PolicyHook, OctavesDoNotChangeOnAnEdgeThatExtracts) {
  const Parameters none(nlohmann::json::object(), {}, "params.");
  Seen seen;
  System system = culling_system(seen);
  bool on_edge = true;
  std::vector<int> levels = {8};
  system.orb = [](const Parameters&) { return OrbOptions{.levels = 8}; };
  system.extracts_on_edge = [&](const Parameters&) { return on_edge; };
  check_octaves(system, none);
  system.orb_levels = [&](const Parameters&) { return levels; };
  check_octaves(system, none);
  levels = {8, 6};
  EXPECT_THROW(check_octaves(system, none), Error);
  on_edge = false;
  check_octaves(system, none);
}

TEST(PolicyHook, TrackingSeesWhatThePolicyLeaves) {
  const testing::TemporaryFolder folder;
  synth::GeneratorOptions options;
  options.width = kWidth;
  options.height = kHeight;
  options.fps = 15;
  options.seconds = 1;
  synth::generate(options, folder.path() / "sequence", 2, [](int, int) { return true; });
  const nlohmann::json cost{{"a_us", 3000}, {"b_us", 0}, {"c_us", 0}, {"jitter", 0}};
  const nlohmann::json playback{
      {"mode", "every_frame"}, {"fps", nullptr}, {"start_s", 0.0}, {"end_s", nullptr}};
  folder.write("run.json", nlohmann::json{{"format", "slambed-run"},
                                          {"version", 1},
                                          {"run_key", "hook"},
                                          {"seed", 1},
                                          {"system", "culling"},
                                          {"variant", "default"},
                                          {"params", nlohmann::json::object()},
                                          {"sequence", folder.path() / "sequence"},
                                          {"playback", playback},
                                          {"network", nullptr},
                                          {"output", folder.path()},
                                          {"connect_timeout_s", 1.0}}
                               .dump());
  const nlohmann::json stages{{"extract", cost}, {"track", cost}, {"relocalize", cost}};
  const nlohmann::json mobile{{"cores", 2}, {"speed", 1.0}, {"stages", stages}};
  folder.write("sim.json", nlohmann::json{{"format", "slambed-sim"},
                                          {"version", 1},
                                          {"run", "run.json"},
                                          {"devices", {{"mobile", mobile}, {"edge", nullptr}}},
                                          {"link", nullptr},
                                          {"edge_frozen_s", nlohmann::json::array()},
                                          {"feature_cache", nullptr}}
                               .dump());
  Seen seen;
  const System system = culling_system(seen);
  run_virtually(folder.path() / "sim.json", {&system, 1});

  EXPECT_EQ(seen.frames, 15);
  EXPECT_EQ(seen.pictures, seen.frames);
  EXPECT_EQ(seen.fine, seen.frames);
  EXPECT_EQ(seen.given, seen.tracked);
  ASSERT_GT(seen.given.size(), static_cast<std::size_t>(kDark));
  EXPECT_EQ(seen.given[kDark], 0);
  EXPECT_EQ(std::count(seen.given.begin(), seen.given.end(), 0), 1);
  EXPECT_EQ(seen.lost, 1);

  // The cost of extraction depends on the octaves: the stage reports their pixels in full images.
  std::istringstream lines(testing::read_text(folder.path() / "mobile" / "events.jsonl"));
  int extracted = 0;
  for (std::string line; std::getline(lines, line);) {
    const auto event = nlohmann::json::parse(line);
    if (event["type"] != "stage" || event["name"] != "extract") continue;
    EXPECT_NEAR(event["n2"].get<double>(), 3.1, 0.1);
    ++extracted;
  }
  EXPECT_EQ(extracted, seen.frames);
}

}  // namespace
}  // namespace slambed
