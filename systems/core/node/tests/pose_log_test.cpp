// SPDX-License-Identifier: Apache-2.0
#include "node/pose_log.hpp"

#include <gtest/gtest.h>

#include "base/error.hpp"
#include "base/tests/temporary_folder.hpp"

namespace slambed {
namespace {

KeyFrameId kf(std::uint64_t n) { return {std::uint64_t{1} << 56 | n}; }
SE3 moved(double x) { return {Eigen::Matrix3d(Eigen::Matrix3d::Identity()), {x, 0, 0}}; }

TEST(PoseBook, APlacedKeyframeIsWhereItWasPlaced) {
  PoseBook book;
  book.created(kf(1), {}, SE3(), moved(0));
  book.placed(kf(1), moved(3));
  book.placed(kf(1), moved(4));
  EXPECT_EQ(book.pose(kf(1))->t.x(), 4);
  EXPECT_FALSE(book.pose(kf(9)));
}

TEST(PoseBook, AnUnplacedKeyframeFollowsTheOneItWasMadeAgainst) {
  PoseBook book;
  book.created(kf(1), {}, SE3(), moved(0));
  book.created(kf(2), kf(1), moved(1), moved(1));
  book.created(kf(3), kf(2), moved(1), moved(2));
  EXPECT_EQ(book.pose(kf(3))->t.x(), 2);
  book.placed(kf(1), moved(10));
  EXPECT_EQ(book.pose(kf(3))->t.x(), 12);
  book.placed(kf(3), moved(5));
  EXPECT_EQ(book.pose(kf(3))->t.x(), 5);
  EXPECT_EQ(book.pose(kf(2))->t.x(), 11);
  EXPECT_EQ(book.keyframes(), (std::vector<KeyFrameId>{kf(1), kf(2), kf(3)}));
}

TEST(PoseBook, UnknownOrOwnReferenceEndsTheChain) {
  PoseBook book;
  book.created(kf(2), kf(1), moved(1), moved(7));
  book.created(kf(3), kf(3), moved(1), moved(8));
  EXPECT_EQ(book.pose(kf(2))->t.x(), 7);
  EXPECT_EQ(book.pose(kf(3))->t.x(), 8);
}

TEST(PoseLog, WritesTimesBeforeZero) {
  testing::TemporaryFolder folder;
  PoseLog log;
  log.add(-500'000'000, moved(0), kf(1), moved(0));
  log.add(-2'000'000'001, moved(0), kf(1), moved(0));
  log.write_live(folder.path() / "live.txt");
  const std::string text = testing::read_text(folder.path() / "live.txt");
  EXPECT_NE(text.find("\n-0.500000000 "), std::string::npos) << text;
  EXPECT_NE(text.find("\n-2.000000001 "), std::string::npos) << text;
}

TEST(PoseLog, WritesTumLinesThroughTheReferences) {
  testing::TemporaryFolder folder;
  PoseLog log;
  log.add(1'305'031'102'175'304'000, moved(1), kf(1), moved(1));
  log.add(1'305'031'102'211'214'001, moved(2), kf(7), moved(0.5));  // an unknown keyframe
  PoseBook book;
  book.created(kf(1), {}, SE3(), moved(0));
  book.placed(kf(1), moved(0.25));
  log.write_live(folder.path() / "live.txt");
  log.write_final(folder.path() / "final.txt", book);
  EXPECT_EQ(testing::read_text(folder.path() / "live.txt"),
            "# timestamp tx ty tz qx qy qz qw (camera to world)\n"
            "1305031102.175304000 -1.000000000 -0.000000000 -0.000000000 0.000000000 0.000000000 "
            "0.000000000 1.000000000\n"
            "1305031102.211214001 -2.000000000 -0.000000000 -0.000000000 0.000000000 0.000000000 "
            "0.000000000 1.000000000\n");
  const std::string text = testing::read_text(folder.path() / "final.txt");
  EXPECT_NE(text.find("1305031102.175304000 -1.250000000"), std::string::npos);
  EXPECT_NE(text.find("1305031102.211214001 -2.000000000"), std::string::npos);
  log.clear();
  EXPECT_EQ(log.size(), 0u);
  EXPECT_THROW(log.write_live("/nonexistent-folder/x"), Error);
}

}  // namespace
}  // namespace slambed
