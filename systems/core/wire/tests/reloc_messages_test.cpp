// SPDX-License-Identifier: Apache-2.0
#include "wire/reloc_messages.hpp"

#include <gtest/gtest.h>

#include <limits>

#include "wire/tests/decoders.hpp"

namespace slambed::wire {
namespace {

class RelocMessages : public ::testing::Test {
 protected:
  std::mt19937 random_{5};
  SensorPtr sensor_ = example_camera().make_sensor();
};

TEST_F(RelocMessages, AFoundFrameComesAsItLeft) {
  RelocOk found = example_found(random_, sensor_, 40);
  found.T_cw = SE3::exp((Eigen::Matrix<double, 6, 1>() << 0.3, -2, 1, 0.1, 0.7, -0.2).finished());
  const FrameMessage frame{3, 0.5, example_features(random_, 5, sensor_)};
  for (const RelocOk& read :
       {decode_reloc_ok(encode(found), sensor_),
        decode_reloc_ok_text(encode_text(found, frame, *default_vocabulary()), sensor_)}) {
    EXPECT_EQ(read.number, found.number);
    EXPECT_EQ(read.update, found.update);
    EXPECT_EQ(read.times.queued, found.times.queued);
    EXPECT_EQ(read.times.received, found.times.received);
    EXPECT_TRUE(read.jumped);
    EXPECT_LT((read.T_cw.R - found.T_cw.R).norm(), 1e-12);
    EXPECT_EQ(read.T_cw.t, found.T_cw.t);
    EXPECT_EQ(read.matches, found.matches);
    ASSERT_EQ(read.keyframe.keyframes.size(), 1u);
    EXPECT_EQ(read.keyframe.keyframes[0].points, found.keyframe.keyframes[0].points);
    EXPECT_EQ(read.keyframe.points.size(), found.keyframe.points.size());
  }
}

TEST_F(RelocMessages, APointThatIsNotThereIsRefused) {
  RelocOk found = example_found(random_, sensor_, 40);
  found.matches.emplace_back(std::uint16_t{0}, point_id(77'777));
  EXPECT_THROW(decode_reloc_ok(encode(found), sensor_), DecodeError);
}

TEST_F(RelocMessages, APoseThatIsNoPoseIsRefused) {
  RelocOk found = example_found(random_, sensor_, 40);
  found.T_cw.t.x() = std::numeric_limits<double>::infinity();
  EXPECT_THROW(decode_reloc_ok(encode(found), sensor_), DecodeError);
}

TEST_F(RelocMessages, NoiseIsRefused) {
  Bytes noise(75'000);
  for (auto& byte : noise) byte = static_cast<std::uint8_t>(random_());
  EXPECT_THROW(decode_reloc_ok(noise, sensor_), DecodeError);
  EXPECT_THROW(decode_reloc_request(noise, sensor_), DecodeError);
  EXPECT_THROW(decode_reloc_fail(noise), DecodeError);
}

TEST_F(RelocMessages, AFailureIsAsLongAsItIsTold) {
  const RelocFail failed{300, {RunTime(5), RunTime(9)}, RelocFailure::kNotFound, 75'000};
  const Bytes bytes = encode(failed);
  EXPECT_GT(bytes.size(), 75'000u);
  EXPECT_LT(bytes.size(), 75'040u);
  EXPECT_EQ(decode_reloc_fail(bytes).number, 300u);
}

}  // namespace
}  // namespace slambed::wire
