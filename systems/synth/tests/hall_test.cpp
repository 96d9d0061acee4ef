// SPDX-License-Identifier: Apache-2.0
#include "synth/hall.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "features/orb_extractor.hpp"
#include "synth/robot_path.hpp"
#include "synth/sensor.hpp"
#include "synth/tests/sequence_folder.hpp"

namespace slambed::synth {
namespace {

double degrees_between(const SE3& a, const SE3& b) {
  return (a.inverse() * b).log().tail<3>().norm() * 57.29577951308232;
}

TEST(RobotPath, DrivesAheadTurnsInPlaceAndKeepsItsHeight) {
  constexpr double kStep_s = 1.0 / 30;
  for (const std::string& name : robot_path_names()) {
    for (const std::uint64_t seed : {1, 9}) {
      const auto path = make_robot_path(name, seed);
      double fastest_m_s = 0, fastest_deg_s = 0;
      for (double t = 0; t + kStep_s < path->duration_s(); t += kStep_s) {
        const SE3 a = path->at(t), b = path->at(t + kStep_s);
        const Eigen::Vector3d step = b.t - a.t;
        ASSERT_NEAR(a.t.z(), 0.75, 0.002) << name << " at " << t;
        ASSERT_NEAR(a.R(2, 2), std::sin(-2 / 57.29577951308232), 0.002) << name << " at " << t;
        const double m_s = step.head<2>().norm() / kStep_s;
        const double deg_s = degrees_between(a, b) / kStep_s;
        fastest_m_s = std::max(fastest_m_s, m_s);
        fastest_deg_s = std::max(fastest_deg_s, deg_s);
        // Vibration alone rotates the camera by up to 4 degrees per second.
        if (m_s > 0.05) {
          ASSERT_LT(deg_s, 6) << name << " at " << t;
          ASSERT_GT(step.head<2>().dot(a.R.col(2).head<2>()), 0.99 * step.head<2>().norm());
        }
        ASSERT_LT(std::abs(a.t.x()), 7.5) << name << " at " << t;
        ASSERT_LT(std::abs(a.t.y()), 5.5) << name << " at " << t;
      }
      EXPECT_LT(fastest_m_s, 0.41) << name;
      EXPECT_LT(fastest_deg_s, 62) << name;
      EXPECT_GT(fastest_deg_s, 28) << name;
    }
  }
  EXPECT_DOUBLE_EQ(make_robot_path("pioneer2", 1)->duration_s(), 115.6);
  EXPECT_THROW(make_robot_path("pioneer5", 1), Error);
}

/// Returns how many ORB features a camera near the hall's center sees in this direction.
std::size_t features(double yaw_deg) {
  static const auto scene = make_hall({.texel_scale = 1, .threads = 2}, {});
  class Standing final : public CameraPath {
   public:
    explicit Standing(double yaw_deg) : yaw_deg_(yaw_deg) {}
    SE3 at(double) const override { return {look(yaw_deg_, -2, 0), {0, -1.6, 0.75}}; }
    double duration_s() const override { return 1; }

   private:
    double yaw_deg_;
  };
  SensorModel sensor(scene, generator_camera({}), {.motion_blur_s = 0.02, .noise = 2});
  const Shot shot = sensor.capture_mono(Standing(yaw_deg), 1, 0.5);
  OrbExtractor extractor({});
  std::vector<RawKeyPoint> keypoints;
  std::vector<Descriptor> descriptors;
  extractor.extract({shot.gray.data(), 640, 480, 640}, keypoints, descriptors);
  return keypoints.size();
}

TEST(Hall, IslandsHaveFeaturesAndTheSouthHasNone) {
  for (const double yaw_deg : {128.0, 88.0, 50.0, 8.0, 176.0}) EXPECT_GT(features(yaw_deg), 400u);
  for (const double yaw_deg : {-120.0, -90.0, -60.0}) EXPECT_LT(features(yaw_deg), 60u) << yaw_deg;
}

class HallSequence : public SequenceFolder {
 protected:
  static GeneratorOptions driven() {
    GeneratorOptions options = small();
    options.trajectory = "pioneer3";
    options.sensor_model = {
        .motion_blur_s = 0.02, .noise = 2, .depth_noise = 1, .depth_holes = 0.02, .max_depth_m = 5};
    return options;
  }
};

// Every machine must give the same bytes; see generator_test.cpp.
TEST_F(HallSequence, BytesAreTheKnownOnes) {
  const auto header = make(driven(), "one", 2);
  EXPECT_EQ(header["checksum"], "521a235beff98dd8970b11f2810fc0e3981676c4b8fcdf02b1323050758d0d09");
  EXPECT_EQ(header["source"]["max_depth_m"], 5);
  GeneratorOptions desk = driven();
  desk.trajectory = "desk";
  desk.people = 1;
  desk.activity = "sitting";
  EXPECT_EQ(make(desk, "desk", 2)["checksum"],
            "d32e7d6442c6712c34f369ea536bfb9b4fbdd4bc683da1c569446939bdfe5ca2");
}

TEST_F(HallSequence, NothingFartherThanTheLimitHasDepth) {
  GeneratorOptions options = driven();
  options.sensor_model.max_depth_m = 4;
  make(options, "near", 2);
  const std::string bytes = slurp(folder_ / "near" / "frames.bin");
  double farthest_m = 0;
  for (std::size_t i = 0; i < 160 * 120; ++i) {
    std::uint16_t raw = 0;
    std::memcpy(&raw, bytes.data() + 160 * 120 + 2 * i, 2);
    farthest_m = std::max(farthest_m, raw * 0.0002);
  }
  EXPECT_GT(farthest_m, 3);
  EXPECT_LT(farthest_m, 4.2);  // the limit applies to the depth before noise
}

TEST_F(HallSequence, TakesNoPeople) {
  GeneratorOptions options = driven();
  options.people = 1;
  EXPECT_NE(rejected(options).find("hall"), std::string::npos);
}

}  // namespace
}  // namespace slambed::synth
