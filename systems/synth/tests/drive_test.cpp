// SPDX-License-Identifier: Apache-2.0
#include "synth/drive.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/error.hpp"

namespace slambed::synth {
namespace {

constexpr double kFrame_s = 1.0 / 15;

struct Table2 {
  const char* name;
  int frames;
  double length_m, top_m_s;
};

/// CloudSLAM (SEC 2020), Table II; 1 mph is 0.44704 m/s.
constexpr Table2 kTable2[] = {{"rectangle", 1922, 598, 15 * 0.44704},
                              {"circular", 2984, 1450, 24 * 0.44704}};

TEST(Drive, SecondLapIsThePublishedOne) {
  for (const Table2& wanted : kTable2) {
    const Drive drive(wanted.name, 1);
    const double begin = drive.second_lap_s();
    EXPECT_EQ(begin, std::floor(begin));  // so that any integer frame rate has a frame there
    EXPECT_EQ(std::lround((drive.duration_s() - begin) * 15), wanted.frames);
    double length = 0, top = 0, standing = 0;
    for (int i = 0; i + 1 < wanted.frames; ++i) {
      const double t = begin + i * kFrame_s;
      const Vec3 a = drive.at(t).t, b = drive.at(t + kFrame_s).t;
      length += (b - a).head<2>().norm();
      top = std::max(top, drive.speed_m_s(t));
      if (drive.speed_m_s(t) < 0.01) standing += kFrame_s;
    }
    EXPECT_NEAR(length, wanted.length_m, 1) << wanted.name;
    EXPECT_NEAR(top, wanted.top_m_s, 0.01 * wanted.top_m_s) << wanted.name;
    EXPECT_GT(standing, 2) << wanted.name;
  }
}

TEST(Drive, FirstLapClosesItsLoopBeforeTheSecond) {
  for (const char* name : {"rectangle", "circular", "block"}) {
    const Drive drive(name, 1);
    EXPECT_LE(drive.traveled_m(0), -30);
    EXPECT_NEAR(drive.traveled_m(drive.second_lap_s()), drive.route().length_m(), 0.01);
    // The last 30 m of lap 1 are the same places as its first 30 m.
    const double s = drive.route().length_m() - 10;
    EXPECT_LT((drive.route().at(s) - drive.route().at(-10)).norm(), 1e-6);
  }
}

TEST(Drive, LapsRunBesideEachOtherAtDifferentSpeeds) {
  const Drive drive("rectangle", 1);
  double widest = 0;
  int slower = 0, samples = 0;
  for (double t = 0; t < drive.second_lap_s(); t += 0.1) {
    const double s = drive.traveled_m(t);
    if (s < 0) continue;
    double again = drive.second_lap_s();  // when lap 2 passes this place
    while (drive.traveled_m(again) < s + drive.route().length_m()) again += 0.05;
    const Vec3 apart = drive.at(again).t - drive.at(t).t;
    const SinCos ahead = sincos_turns(drive.route().heading_turns(s));
    widest = std::max(widest, std::abs(apart.dot(Vec3(-ahead.sin, ahead.cos, 0))));
    slower += drive.speed_m_s(again) < drive.speed_m_s(t) - 0.1;
    ++samples;
  }
  EXPECT_GT(widest, 0.25);
  EXPECT_LT(widest, 0.41);
  EXPECT_GT(slower, samples / 3);
}

TEST(Drive, MovesAsACarDoes) {
  for (const char* name : {"rectangle", "circular", "block"}) {
    const Drive drive(name, 7);
    double last = drive.speed_m_s(0);
    for (double t = 0; t + 0.1 < drive.duration_s(); t += 0.1) {
      const double speed = drive.speed_m_s(t);
      ASSERT_GE(speed, -1e-6) << name << " at " << t;
      ASSERT_LT(std::abs(speed - last) / 0.1, 2.5) << name << " at " << t;
      const SE3 a = drive.at(t), b = drive.at(t + 0.1);
      ASSERT_LT((a.inverse() * b).log().tail<3>().norm() * 57.29578 / 0.1, 40) << name << t;
      // The camera looks in the direction of motion.
      if (speed > 1) {
        const Vec3 step = (b.t - a.t).normalized();
        ASSERT_GT(step.dot(a.R.col(2)), 0.98) << name << " at " << t;
      }
      last = speed;
    }
  }
}

TEST(Route, ClosesAndNeverMeetsItself) {
  for (const char* name : {"rectangle", "circular", "block"}) {
    const Route route(name);
    const double length = route.length_m();
    EXPECT_LT((route.at(length - 1e-9) - route.at(0)).norm(), 1e-3) << name;
    const double turned = route.heading_turns(length) - route.heading_turns(0);
    EXPECT_NEAR(std::abs(turned), 1, 1e-9) << name;
    for (double s = 0; s < length; s += 5)
      for (double other = s + 40; other < std::min(length, s + length - 40); other += 5)
        ASSERT_GT((route.at(s) - route.at(other)).norm(), 12) << name << " " << s << " " << other;
  }
  EXPECT_THROW(Route("triangle"), Error);
}

TEST(Route, CircularHasNoLongStraight) {
  const Route route("circular");
  constexpr double kStraight_per_m = 1.0 / 500;
  double straight = 0, longest = 0;
  for (double s = 0; s < 2 * route.length_m(); s += 0.5) {
    straight = std::abs(route.curvature(s)) < kStraight_per_m ? straight + 0.5 : 0;
    longest = std::max(longest, straight);
    const double change = route.heading_turns(s + 0.01) - route.heading_turns(s);
    ASSERT_NEAR(route.curvature(s + 0.005), change / 0.01 * 6.283185307, 1e-4);
  }
  EXPECT_LT(longest, 60);
}

}  // namespace
}  // namespace slambed::synth
