// SPDX-License-Identifier: Apache-2.0
// Digests over every bit of geometry results. CTest also runs this with the features of an older
// processor, for which the C library selects other variants of sin, exp and log.
#include <gtest/gtest.h>

#include <bit>
#include <cstdint>

#include "base/random.hpp"
#include "geometry/sim3.hpp"
#include "geometry/two_view.hpp"

namespace slambed {
namespace {

/// FNV-1a over the bits of doubles.
class Digest {
 public:
  template <typename Matrix>
  void add(const Matrix& m) {
    for (int i = 0; i < m.size(); ++i) add_number(m.data()[i]);
  }
  void add_number(double x) {
    value_ = (value_ ^ std::bit_cast<std::uint64_t>(x)) * 0x100000001B3u;
  }
  std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xCBF29CE484222325u;
};

Vector7 tangent(SplitMix64& random) {
  Vector7 x;
  for (int i = 0; i < 7; ++i) x(i) = random.uniform(-1, 1);
  return x;
}

TEST(SameBits, OfRigidMotions) {
  SplitMix64 random(1);
  Digest digest;
  for (int i = 0; i < 20'000; ++i) {
    const SE3 T = SE3::exp(2 * tangent(random).head<6>());
    digest.add(T.R);
    digest.add(T.t);
    digest.add(T.log());
  }
  EXPECT_EQ(digest.value(), 16677356545596457167u);
}

TEST(SameBits, OfSimilarities) {
  SplitMix64 random(2);
  Digest digest;
  for (int i = 0; i < 20'000; ++i) {
    const Sim3 S = sim3_exp(tangent(random));
    digest.add_number(S.scale);
    digest.add(S.t);
    digest.add(sim3_log(S));
  }
  EXPECT_EQ(digest.value(), 4552606564593939066u);
}

TEST(SameBits, OfTwoViews) {
  const Camera camera{.fx = 500, .fy = 500, .cx = 320, .cy = 240, .bf = 0};
  SplitMix64 random(3);
  Digest digest;
  for (int scene = 0; scene < 5; ++scene) {
    const SE3 T_21 = SE3::exp(0.2 * tangent(random).head<6>());
    std::vector<PixelPair> pairs;
    for (int i = 0; i < 150; ++i) {
      // Braces, because compilers order the arguments of a call as they like.
      const Eigen::Vector3d p{random.uniform(-2, 2), random.uniform(-1.5, 1.5),
                              random.uniform(3, 8)};
      const Eigen::Vector2d noise{random.uniform(-0.5, 0.5), random.uniform(-0.5, 0.5)};
      pairs.push_back({camera.project(p), camera.project(T_21 * p) + noise});
    }
    const TwoViewResult found = reconstruct_two_views(camera, pairs, {});
    digest.add_number(found.parallax_deg);
    digest.add(found.T_21.R);
    for (const Eigen::Vector3d& p : found.p_1) digest.add(p);
  }
  EXPECT_EQ(digest.value(), 2340943243961977778u);
}

}  // namespace
}  // namespace slambed
