// SPDX-License-Identifier: Apache-2.0
#include "synth/camera_path.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "base/error.hpp"

namespace slambed::synth {
namespace {

double degrees_between(const SE3& a, const SE3& b) {
  return (a.inverse() * b).log().tail<3>().norm() * 57.29577951308232;
}

TEST(CameraPath, NamedPathsMoveAsAHandDoes) {
  for (const char* name : {"spline", "office", "desk", "two_laps", "xyz", "halfsphere"}) {
    for (const std::uint64_t seed : {1, 7}) {
      const auto path = make_path(name, 0, seed);
      const double dt = 1.0 / 30;
      for (double t = 0; t + 2 * dt < path->duration_s(); t += dt) {
        const SE3 a = path->at(t), b = path->at(t + dt), c = path->at(t + 2 * dt);
        const Eigen::Vector3d v1 = (b.t - a.t) / dt, v2 = (c.t - b.t) / dt;
        ASSERT_LT(v1.norm(), 0.9) << name << " at " << t;
        ASSERT_LT((v2 - v1).norm() / dt, 6) << name << " at " << t;
        ASSERT_LT(degrees_between(a, b) / dt, 85) << name << " at " << t;
        ASSERT_NEAR(a.R.determinant(), 1, 1e-9);
      }
    }
  }
}

TEST(CameraPath, OfficeTurnsFastOnlyBetween22And25Seconds) {
  const auto path = make_path("office", 0, 1);
  EXPECT_DOUBLE_EQ(path->duration_s(), 87);
  const auto fastest = [&](double from, double to) {
    double most = 0;
    for (double t = from; t < to; t += 0.1)
      most = std::max(most, degrees_between(path->at(t), path->at(t + 0.1)) / 0.1);
    return most;
  };
  EXPECT_GT(fastest(22.5, 24.5), 50);
  EXPECT_LT(fastest(0, 21.8), 32);
  EXPECT_LT(fastest(25.2, 86), 40);
}

TEST(CameraPath, SecondLapComesBackToTheFirst) {
  const auto path = make_path("two_laps", 0, 1);
  for (double t = 0; t < 48; t += 1) {
    EXPECT_LT((path->at(t).t - path->at(t + 48).t).norm(), 0.2) << t;
    EXPECT_LT(degrees_between(path->at(t), path->at(t + 48)), 6) << t;
  }
}

class PathFile : public testing::Test {
 protected:
  void TearDown() override { std::filesystem::remove(file_); }
  void write(const std::string& text) { std::ofstream(file_) << text; }
  std::filesystem::path file_ =
      std::filesystem::path(testing::TempDir()) / ("path_" + std::to_string(getpid()) + ".txt");
};

TEST_F(PathFile, RecordedPathKeepsItsMotionAndIsRecentered) {
  std::string text = "# comment\n";
  for (int i = 0; i <= 300; ++i) {
    const double t = i * 0.01, half = 0.25 * t;
    char line[200];
    // Rotates about z at 0.5 rad/s along a straight line; every other quaternion is negated.
    const double sign = i % 2 == 0 ? 1 : -1;
    std::snprintf(line, sizeof line, "%.4f %.6f 3.0 9.0 0 0 %.9f %.9f\n", 50 + t, 10 + 0.4 * t,
                  sign * std::sin(half), sign * std::cos(half));
    text += line;
  }
  write(text);
  const RecordedPath recorded = read_path(file_, 1.4);
  EXPECT_DOUBLE_EQ(recorded.start_s, 50);
  EXPECT_NEAR(recorded.path->duration_s(), 3, 1e-9);
  for (double t = 0.2; t < 2.8; t += 0.1) {
    const SE3 pose = recorded.path->at(t);
    EXPECT_NEAR(pose.t.x(), 0.4 * (t - 1.5), 5e-3);
    EXPECT_NEAR(pose.t.y(), 0, 1e-9);
    EXPECT_NEAR(pose.t.z(), 1.4, 1e-9);
    EXPECT_NEAR(std::atan2(pose.R(1, 0), pose.R(0, 0)), 0.5 * t, 2e-3);
  }
}

TEST_F(PathFile, BadLinesAreNamed) {
  write("0 0 0 0 0 0 0 1\n0.1 0 0 zero 0 0 0 1\n");
  try {
    read_path(file_);
    FAIL() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::kBadInput);
    EXPECT_NE(std::string(error.what()).find(":2:"), std::string::npos) << error.what();
  }
  EXPECT_THROW(read_path("/nowhere.txt"), Error);
  EXPECT_THROW(make_path("offise", 0, 1), Error);
}

}  // namespace
}  // namespace slambed::synth
