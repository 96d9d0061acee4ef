// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "synth/cast.hpp"
#include "synth/figure_body.hpp"
#include "synth/labels.hpp"
#include "synth/sha256.hpp"
#include "synth/tests/sequence_folder.hpp"

namespace slambed::synth {
namespace {

std::vector<Figure> cast(const std::string& activity, int people, std::uint64_t seed) {
  return make_cast({people, activity, seed, 20}, *make_path("xyz", 20, seed));
}

TEST(Skeleton, StraightOneIsAsTallAsItsBuildAndStandsOnTheFloor) {
  const Build build{1.8, 1};
  Stance stance;
  stance.pelvis.z() = standing_hip_m(build, stance);
  const PartPoses parts = place_parts(build, stance);
  EXPECT_NEAR((parts[kHead] * Vec3(0, 0, build.head_m())).z(), 1.8, 1e-12);
  const auto joints = keypoints(build, parts);
  EXPECT_NEAR(joints[15].z(), build.ankle_m(), 1e-12);
  EXPECT_GT(joints[5].y(), 0);     // the left shoulder is to the left
  EXPECT_GT(joints[0].x(), 0.05);  // the nose is ahead
  EXPECT_NEAR(joints[9].z(), joints[10].z(), 1e-12);
}

TEST(Skeleton, AnglesBendTheWayJointsDo) {
  const Build build;
  Stance stance;
  stance.arms[0] = {90, 0, 0};
  stance.legs[1] = {0, 0, 90};
  const auto joints = keypoints(build, place_parts(build, stance));
  EXPECT_NEAR(joints[9].x(), build.upper_arm_m() + build.forearm_m(), 1e-12);  // stretched forward
  EXPECT_NEAR(joints[16].x(), -build.shin_m(), 1e-12);                         // shin points back
}

TEST(Actor, WalksWithAFootOnTheFloorAndLiftsTheOther) {
  for (const Figure& figure : cast("walking", 2, 3)) {
    const Build& build = figure.actor->build();
    double walked = 0, highest = 0;
    for (double t = 0; t < 20; t += 0.05) {
      const auto joints = keypoints(build, figure.actor->parts(t));
      ASSERT_NEAR(std::min(joints[15].z(), joints[16].z()), build.ankle_m(), 1e-9) << t;
      highest = std::max(highest, std::max(joints[15].z(), joints[16].z()));
      walked += (figure.actor->stance(t + 0.05).pelvis - figure.actor->stance(t).pelvis).norm();
    }
    EXPECT_GT(walked, 4);
    EXPECT_GT(highest, build.ankle_m() + 0.08);
  }
}

TEST(Cast, KeepsAwayFromTheCameraAndHangsOnTheSeed) {
  const auto path = make_path("xyz", 20, 5);
  for (const std::string& activity : activity_names()) {
    const auto people = cast(activity, 2, 5), again = cast(activity, 2, 5);
    const auto others = cast(activity, 2, 6);
    ASSERT_EQ(people.size(), 2u);
    for (std::size_t i = 0; i < people.size(); ++i) {
      EXPECT_EQ(people[i].actor->stance(7).pelvis, again[i].actor->stance(7).pelvis);
      EXPECT_NE(people[i].actor->stance(7).pelvis, others[i].actor->stance(7).pelvis);
      for (double t = 0; t < 20; t += 0.1) {
        const Vec3 away = people[i].actor->stance(t).pelvis - path->at(t).t;
        ASSERT_GT(std::hypot(away.x(), away.y()), 0.66) << activity << " at " << t;
      }
    }
  }
}

/// A single person, 3 m in front of the camera and facing it.
struct Portrait {
  Portrait() {
    auto built = std::make_shared<Scene>();
    add_figure(*built, figure.actor, 1, 9, 4);
    built->finish({}, 1, 1);
    scene = built;
  }
  Figure figure{std::make_shared<Actor>(Actor::standing({1.75, 1}, {3, 0, 0}, 180, 4)), 9};
  std::shared_ptr<const Scene> scene;
};

TEST(Labels, MaskIsWhereThePersonIsAndJointsLieOnIt) {
  const Portrait portrait;
  Renderer renderer(portrait.scene, generator_camera({}));
  const SE3 T_wc(look(0, 0, 0), Vec3(0, 0, 1));
  const auto people = label_people(renderer, std::span(&portrait.figure, 1), T_wc, 0);
  ASSERT_EQ(people.size(), 1u);
  const Picture picture = renderer.render(T_wc, 0);
  std::vector<bool> mask;
  for (std::size_t i = 0; i < people[0].runs.size(); ++i)
    mask.insert(mask.end(), people[0].runs[i], i % 2 == 1);
  ASSERT_EQ(mask.size(), picture.gray.size());
  for (std::size_t i = 0; i < mask.size(); ++i) ASSERT_EQ(mask[i], picture.depth_m[i] > 0) << i;
  for (const Keypoint& joint : people[0].keypoints) {
    ASSERT_GT(joint.visibility, 0u);
    EXPECT_TRUE(
        mask[static_cast<int>(joint.v_px + 0.5f) * 640 + static_cast<int>(joint.u_px + 0.5f)]);
  }
  EXPECT_EQ(people[0].keypoints[0].visibility, 2u);                     // it looks into the camera
  EXPECT_GT(people[0].keypoints[5].u_px, people[0].keypoints[6].u_px);  // its left is our right
}

TEST(Labels, WhoIsOutOfThePictureHasNone) {
  const Portrait portrait;
  Renderer renderer(portrait.scene, generator_camera({}));
  const SE3 away(look(180, 0, 0), Vec3(0, 0, 1));
  EXPECT_TRUE(label_people(renderer, std::span(&portrait.figure, 1), away, 0).empty());
}

class PeopleSequence : public SequenceFolder {
 protected:
  static GeneratorOptions two_sitting() {
    GeneratorOptions options = small();
    options.trajectory = "xyz";
    options.people = 2;
    options.activity = "sitting";
    options.labels = true;
    return options;
  }
};

// For an intended change of the generator, raise kGeneratorVersion and update the checksums.
TEST_F(PeopleSequence, BytesAreTheKnownOnesAndDoNotDependOnThreads) {
  const auto one = make(two_sitting(), "one", 1), three = make(two_sitting(), "three", 3);
  EXPECT_EQ(one, three);
  EXPECT_EQ(slurp(folder_ / "one" / "labels.bin"), slurp(folder_ / "three" / "labels.bin"));
  EXPECT_EQ(one["checksum"], "0dc585c9883ae2d9c5ec190dd5605257bae8ff00f804ee5996a697aa123e937d");
  EXPECT_EQ(one["source"]["labels_sha256"],
            "dfe24ded288532565f82a2ff3d48457d006c29a9c6dca5e3423e667954fc46ba");
  EXPECT_EQ(sha256_hex(slurp(folder_ / "one" / "labels.bin")),
            one["source"]["labels_sha256"].get<std::string>());
}

TEST_F(PeopleSequence, LabelsAreBesideThePicturesNotInThem) {
  GeneratorOptions options = two_sitting();
  const auto with = make(options, "with", 2);
  options.labels = false;
  const auto without = make(options, "without", 2);
  EXPECT_EQ(with["checksum"], without["checksum"]);
  EXPECT_FALSE(fs::exists(folder_ / "without" / "labels.bin"));
  EXPECT_FALSE(without["source"].contains("labels_sha256"));
}

TEST_F(PeopleSequence, BadOptionsAreOneLine) {
  GeneratorOptions options = two_sitting();
  options.activity = "dancing";
  EXPECT_NE(rejected(options).find("'dancing'"), std::string::npos);
  options = two_sitting();
  options.trajectory = "block";
  options.sensor = "mono";
  EXPECT_NE(rejected(options).find("rooms"), std::string::npos);
  options = two_sitting();
  options.sensor_model.flaws.distortion = 0.01;
  EXPECT_NE(rejected(options).find("distortion"), std::string::npos);
}

}  // namespace
}  // namespace slambed::synth
