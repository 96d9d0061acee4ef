// SPDX-License-Identifier: Apache-2.0
#include "wire/trip_messages.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "wire/tests/examples.hpp"

namespace slambed::wire {
namespace {

using namespace std::chrono_literals;

/// FrameHeader::kSize, which is in a layer above this one.
constexpr std::size_t kHeader_bytes = 44;

PoseAnswer example() {
  Eigen::Matrix<double, 6, 1> twist;
  twist << 812.3, -4.2, 651.7, 0.3, 2.1, -0.2;
  return {.keyframe = keyframe_id((1u << 26) - 2),
          .matches = 1234,
          .T_cw = SE3::exp(twist),
          .sent = 100s,
          .up = 420ms,
          .wait = 3ms,
          .match = 25ms,
          .bundle = 31ms};
}

TEST(PoseAnswer, ComesBackWithinATenthOfAMillimetre) {
  const PoseAnswer sent = example();
  const Bytes bytes = encode(sent);
  EXPECT_LE(bytes.size() + kHeader_bytes, 110u) << "as large as the authors' messages";
  const PoseAnswer got = decode_pose_answer(bytes);
  EXPECT_EQ(got.keyframe, sent.keyframe);
  EXPECT_EQ(got.matches, sent.matches);
  EXPECT_LT((got.T_cw.inverse().t - sent.T_cw.inverse().t).norm(), 1e-4);
  EXPECT_LT((got.T_cw.R - sent.T_cw.R).norm(), 1e-6);
  EXPECT_EQ(got.sent, sent.sent);
  EXPECT_EQ(got.up + got.wait + got.match + got.bundle, 479ms);
  EXPECT_FALSE(defect(got));
}

TEST(PoseAnswer, WhatIsNoPoseIsTold) {
  const Bytes good = encode(example());
  // Seven floats follow the id (5 bytes here) and the matches.
  const auto with = [&](std::size_t place, float value) {
    Bytes bytes = good;
    std::memcpy(bytes.data() + 7 + 4 * place, &value, sizeof value);
    return decode_pose_answer(bytes);
  };
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(defect(with(0, nan)), "not_finite");
  EXPECT_EQ(defect(with(5, nan)), "not_finite");
  EXPECT_EQ(defect(with(2, std::numeric_limits<float>::infinity())), "not_finite");
  EXPECT_EQ(defect(with(3, 1.5f)), "not_a_rotation");
  PoseAnswer mirrored = example();
  mirrored.T_cw.R = -Eigen::Matrix3d::Identity();
  EXPECT_EQ(defect(mirrored), "not_a_rotation");
}

TEST(Filler, GrowsAMessageAndIsNotRead) {
  const Bytes own{1, 2, 3};
  const Bytes filled = fill_up(own, 500'000);
  EXPECT_EQ(filled.size(), 500'000u);
  const auto back = without_filler(filled);
  EXPECT_EQ(Bytes(back.begin(), back.end()), own);
  EXPECT_EQ(fill_up(own, 0).size(), own.size() + 8);
  EXPECT_EQ(without_filler(fill_up(own, 5)).size(), own.size()) << "larger than asked for";
  EXPECT_THROW(without_filler(Bytes{9, 0, 0, 0, 0, 0, 0, 0, 1}), DecodeError);
}

}  // namespace
}  // namespace slambed::wire
