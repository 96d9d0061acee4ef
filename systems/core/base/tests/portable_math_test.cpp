// SPDX-License-Identifier: Apache-2.0
// Checks the bounds that portable_math.hpp states against long double, and the exact bits.
#include "base/portable_math.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>

#include "base/random.hpp"

namespace slambed {
namespace {

constexpr int kArguments = 100'000;

/// Returns the distance of a value from the exact one in units in the last place of the exact one.
double ulps(double value, long double exact) {
  const double size = std::max(std::abs(static_cast<double>(exact)), 0x1p-1021);
  const double unit = std::nextafter(size, INFINITY) - size;
  return static_cast<double>(std::abs(static_cast<long double>(value) - exact)) / unit;
}

struct Interval {
  double from, to;
  double at(SplitMix64& random) const { return from + (to - from) * random.uniform(); }
};

/// Returns the worst error, in ulp, over random arguments of all intervals.
double worst(std::initializer_list<Interval> intervals, const std::function<double(double)>& own,
             const std::function<long double(long double)>& exact) {
  SplitMix64 random(1);
  double found = 0;
  for (const Interval& interval : intervals) {
    for (int i = 0; i < kArguments; ++i) {
      const double x = interval.at(random);
      found = std::max(found, ulps(own(x), exact(x)));
    }
  }
  return found;
}

#define OWN(function) [](double x) { return portable::function(x); }
#define EXACT(function) [](long double x) { return std::function(x); }

TEST(PortableMath, SineAndCosineAreWithinOneUnitInTheLastPlace) {
  const auto angles = {Interval{-1e-9, 1e-9}, {-0.8, 0.8}, {-7, 7}, {-1000, 1000}};
  EXPECT_LE(worst(angles, OWN(sin), EXACT(sin)), 1);
  EXPECT_LE(worst(angles, OWN(cos), EXACT(cos)), 1);
  // Near zeros almost all of the angle cancels (exact values from 60-digit arithmetic).
  EXPECT_EQ(portable::cos(1.5707963267948966), 0x1.1a62633145c07p-54);
  EXPECT_EQ(portable::sin(3.141592653589793), 0x1.1a62633145c07p-53);
  EXPECT_EQ(portable::cos(557.6326960121883), -0x1.53cb37c6a9dcfp-45);
  EXPECT_EQ(portable::sin(1115.2653920243765), 0x1.53cb37c6a9dcfp-44);
  EXPECT_EQ(portable::sin(1057328.1403068737), 0x1.5f9261ffb58fap-34);
  EXPECT_EQ(portable::cos(1413715.12331908), -0x1.14d944b112453p-34);
}

TEST(PortableMath, ExponentialsAndLogarithmsKeepTheirBounds) {
  EXPECT_LE(worst({{-1, 1}, {-700, 700}}, OWN(exp), EXACT(exp)), 1);
  EXPECT_LE(worst({{-1e-6, 1e-6}, {-1, 1}, {-40, 40}, {-700, 700}}, OWN(expm1), EXACT(expm1)), 2);
  EXPECT_LE(worst({{0.5, 2}, {0.999, 1.001}, {0, 1e-300}, {0, 1e9}}, OWN(log), EXACT(log)), 1);
  EXPECT_LE(worst({{-1e-9, 1e-9}, {-0.5, 0.5}, {-1, 3}, {0, 1e9}}, OWN(log1p), EXACT(log1p)), 1);
}

TEST(PortableMath, InverseAnglesKeepTheirBounds) {
  EXPECT_LE(worst({{-1, 1}, {0.999999, 1}, {-1, -0.999}}, OWN(acos), EXACT(acos)), 3);
  SplitMix64 random(2);
  for (int i = 0; i < kArguments; ++i) {
    const double scale = portable::exp(40 * random.uniform() - 20);
    const double y = (2 * random.uniform() - 1) * scale, x = 2 * random.uniform() - 1;
    ASSERT_LE(ulps(portable::atan2(y, x), std::atan2(static_cast<long double>(y), x)), 2)
        << y << ' ' << x;
  }
}

TEST(PortableMath, PowersKeepTheirBounds) {
  SplitMix64 random(3);
  for (int i = 0; i < kArguments; ++i) {
    const double x = 20 * random.uniform(), y = 20 * random.uniform() - 10;
    const long double exact = std::pow(static_cast<long double>(x), y);
    ASSERT_LE(ulps(portable::pow(x, y), exact), 2 + 2 * std::abs(y * std::log(x))) << x << ' ' << y;
    const int n = static_cast<int>(random.below(12));
    ASSERT_LE(ulps(portable::power(x, n), std::pow(static_cast<long double>(x), n)), n / 2.0);
  }
}

TEST(PortableMath, TheComplementaryErrorFunctionIsWithinItsRelativeError) {
  SplitMix64 random(4);
  for (int i = 0; i < kArguments; ++i) {
    const double x = 52 * random.uniform() - 26;
    for (const double at : {x, x / 10}) {
      const long double exact = std::erfc(static_cast<long double>(at));
      ASSERT_LE(std::abs(portable::erfc(at) - exact), 1e-13L * exact + 0x1p-1022L) << at;
    }
  }
}

TEST(PortableMath, EndsOfTheRangesAreWhatTheyShouldBe) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(portable::sin(0.0), 0.0);
  EXPECT_EQ(portable::cos(0.0), 1.0);
  EXPECT_EQ(portable::exp(0.0), 1.0);
  EXPECT_EQ(portable::log(1.0), 0.0);
  EXPECT_EQ(portable::acos(1.0), 0.0);
  EXPECT_EQ(portable::acos(-1.0), 3.141592653589793);
  EXPECT_EQ(portable::atan2(0.0, -1.0), 3.141592653589793);
  EXPECT_EQ(portable::atan2(-0.0, -1.0), -3.141592653589793);
  EXPECT_EQ(portable::atan2(1.0, 0.0), 1.5707963267948966);
  EXPECT_EQ(portable::atan2(0.0, 0.0), 0.0);
  EXPECT_EQ(portable::exp(710.0), kInfinity);
  EXPECT_EQ(portable::exp(-746.0), 0.0);
  EXPECT_GT(portable::exp(-745.0), 0.0);
  EXPECT_EQ(portable::log(0.0), -kInfinity);
  EXPECT_EQ(portable::log1p(-1.0), -kInfinity);
  EXPECT_EQ(portable::pow(0.0, -1.0), kInfinity);
  EXPECT_EQ(portable::power(3.0, 4), 81.0);
  for (const double bad : {kInfinity, -kInfinity, std::nan("")}) {
    EXPECT_TRUE(std::isnan(portable::sin(bad)));
    EXPECT_TRUE(std::isnan(portable::cos(bad)));
    EXPECT_TRUE(std::isnan(portable::atan2(bad, 1)));
    EXPECT_TRUE(std::isnan(portable::log1p(bad)));
    EXPECT_TRUE(std::isnan(portable::erfc(bad)));
  }
  EXPECT_TRUE(std::isnan(portable::acos(1.0000001)));
  EXPECT_TRUE(std::isnan(portable::log(-1)));
}

/// Returns the FNV-1a hash of the bits of the results.
std::uint64_t digest(const std::function<double(SplitMix64&)>& draw) {
  SplitMix64 random(5);
  std::uint64_t hash = 0xCBF29CE484222325u;
  for (int i = 0; i < kArguments; ++i) {
    hash = (hash ^ std::bit_cast<std::uint64_t>(draw(random))) * 0x100000001B3u;
  }
  return hash;
}

// These numbers hold on every processor, with every compiler and option. If one changes, the
// results of virtual runs change too.
TEST(SameBits, OfElementaryFunctions) {
  using Random = SplitMix64;
  const auto wide = [](Random& r) { return 200 * r.uniform() - 100; };
  EXPECT_EQ(digest([&](Random& r) { return portable::sin(wide(r)); }), 1848674725691677383u);
  EXPECT_EQ(digest([&](Random& r) { return portable::cos(wide(r)); }), 7922590505601385281u);
  EXPECT_EQ(digest([&](Random& r) { return portable::exp(wide(r)); }), 14922341364251939341u);
  EXPECT_EQ(digest([&](Random& r) { return portable::expm1(wide(r) / 50); }), 2759828101416377666u);
  EXPECT_EQ(digest([&](Random& r) { return portable::log(r.uniform()); }), 2504562067587159512u);
  EXPECT_EQ(digest([&](Random& r) { return portable::log1p(-r.uniform()); }), 1233092940996108055u);
  EXPECT_EQ(digest([&](Random& r) { return portable::acos(2 * r.uniform() - 1); }),
            1077795115696758999u);
  EXPECT_EQ(digest([&](Random& r) { return portable::erfc(wide(r) / 5); }), 16931896220573271961u);
  EXPECT_EQ(digest([&](Random& r) {
              const double y = wide(r);
              return portable::atan2(y, wide(r));
            }),
            4568028952558182849u);
  EXPECT_EQ(digest([](Random& r) { return r.normal(); }), 1798293708139204236u);
}

}  // namespace
}  // namespace slambed
