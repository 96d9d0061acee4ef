// SPDX-License-Identifier: Apache-2.0
// Scoring of a vocabulary: which images count as the same place, and which share is found.
#include "apps/vocabulary/retrieval.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

#include "base/error.hpp"

namespace slambed {
namespace {

namespace fs = std::filesystem;

RetrievalImage image(double time_s, double x_m, std::uint32_t word) {
  return {time_s, SE3(Eigen::Matrix3d::Identity(), {x_m, 0, 0}), {{{word, 1.0f}}, {}}};
}

TEST(Retrieval, CountsPlacesSeenAgainAndHowManyAreFoundFirst) {
  // The places at 0 m and 10 m are visited twice; the second visit at 10 m looks like 20 m.
  const std::vector<RetrievalImage> images{image(0, 0, 1), image(10, 10, 2), image(20, 20, 3),
                                           image(30, 0, 1), image(40, 10, 3)};
  const RetrievalScore score = measure_retrieval(images);
  EXPECT_EQ(score.queries, 4);
  EXPECT_NEAR(score.first, 0.5, 1e-12);
  EXPECT_NEAR(score.first_five, 1, 1e-12);
  EXPECT_NEAR(score.chance, 0.25, 1e-12);
}

TEST(Retrieval, NeighborsInTimeDoNotCount) {
  const std::vector<RetrievalImage> images{image(0, 0, 1), image(1, 0, 1), image(20, 9, 1)};
  EXPECT_EQ(measure_retrieval(images).queries, 0);
}

TEST(Retrieval, TheNearestPoseInTimeIsTakenAndBadFilesAreNamed) {
  const fs::path file = fs::temp_directory_path() / ("slambed_gt_" + std::to_string(::getpid()));
  std::ofstream(file) << "# time tx ty tz qx qy qz qw\n"
                      << "1.00 1 0 0 0 0 0 1\n1.03 2 0 0 0 0 0 1\n";
  const auto poses = read_camera_poses(file);
  ASSERT_EQ(poses.size(), 2u);
  EXPECT_EQ(pose_at(poses, 1.012)->t.x(), 1);
  EXPECT_EQ(pose_at(poses, 1.02)->t.x(), 2);
  EXPECT_EQ(pose_at(poses, 1.045)->t.x(), 2);
  EXPECT_EQ(pose_at(poses, 0.99)->t.x(), 1);
  EXPECT_FALSE(pose_at(poses, 1.2));
  EXPECT_FALSE(pose_at(poses, 0.9));
  EXPECT_FALSE(pose_at({}, 1));
  std::ofstream(file) << "1.00 1 0 0 0 0 0\n";
  EXPECT_THROW(read_camera_poses(file), Error);
  fs::remove(file);
  EXPECT_THROW(read_camera_poses(file), Error);
}

}  // namespace
}  // namespace slambed
