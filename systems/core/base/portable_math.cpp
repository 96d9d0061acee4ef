// SPDX-License-Identifier: Apache-2.0
#include "base/portable_math.hpp"

#include <bit>
#include <cfloat>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <limits>

#include "base/same_bytes.hpp"

namespace slambed::portable {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// ln 2 and pi/2 split into pieces so short that their products with small integers are exact. The
// last piece is the rounded rest.
constexpr double kLn2High = 0x1.62e42fee00000p-1, kLn2Low = 0x1.a39ef35793c76p-33;
constexpr double kHalfPi[] = {0x1.921fb54400000p+0, 0x1.0b4611a600000p-34, 0x1.3198a2e000000p-69,
                              0x1.b839a252049c1p-104};
// pi/2 as a rounded value and the rest.
constexpr double kHalfPiHigh = 0x1.921fb54442d18p+0, kHalfPiLow = 0x1.1a62633145c07p-54;

std::int64_t nearest(double x) { return static_cast<std::int64_t>(x < 0 ? x - 0.5 : x + 0.5); }

/// 2^n for a normal result.
double power_of_two(int n) {
  return std::bit_cast<double>(static_cast<std::uint64_t>(n + 1023) << 52);
}

/// An angle reduced to [-pi/4, pi/4], as high + low, and the number of removed quarter turns mod 4.
struct Reduced {
  double high, low;
  int quadrant;
};

/// Cody and Waite's reduction: subtracts multiples of pi/2 piece by piece and keeps the rounding
/// error of each difference.
Reduced reduce(double x) {
  const std::int64_t quarters = nearest(x * (1 / kHalfPiHigh));
  const auto n = static_cast<double>(quarters);
  double high = x - n * kHalfPi[0], low = 0;
  for (const double piece : {kHalfPi[1], kHalfPi[2], kHalfPi[3]}) {
    const double part = n * piece, before = high;
    high = before - part;
    low += (before - high) - part;
  }
  const double sum = high + low;
  return {sum, (high - sum) + low, static_cast<int>(quarters & 3)};
}

// Taylor series. The first omitted term is below 2^-57 of the result at pi/4.

double sine_of(const Reduced& a) {
  const double x = a.high, z = x * x;
  double r = 1.0 / 355687428096000;  // 17!
  r = -1.0 / 1307674368000 + z * r;
  r = 1.0 / 6227020800 + z * r;
  r = -1.0 / 39916800 + z * r;
  r = 1.0 / 362880 + z * r;
  r = -1.0 / 5040 + z * r;
  r = 1.0 / 120 + z * r;
  const double v = z * x;
  return x - ((z * (0.5 * a.low - v * r) - a.low) - v * (-1.0 / 6));
}

double cosine_of(const Reduced& a) {
  const double x = a.high, z = x * x;
  double r = -1.0 / 6402373705728000;  // 18!
  r = 1.0 / 20922789888000 + z * r;
  r = -1.0 / 87178291200 + z * r;
  r = 1.0 / 479001600 + z * r;
  r = -1.0 / 3628800 + z * r;
  r = 1.0 / 40320 + z * r;
  r = -1.0 / 720 + z * r;
  r = 1.0 / 24 + z * r;
  const double half = 0.5 * z, w = 1 - half;
  return w + (((1 - w) - half) + (z * (z * r) - x * a.low));
}

/// Returns exp(x) - 1 for x = high - low with |x| up to ln(2)/2.
double exp_less_one(double high, double low) {
  const double r = high - low, error = (high - r) - low;
  double p = 1.0 / 87178291200;  // 14!
  for (const double coefficient :
       {1.0 / 6227020800, 1.0 / 479001600, 1.0 / 39916800, 1.0 / 3628800, 1.0 / 362880, 1.0 / 40320,
        1.0 / 5040, 1.0 / 720, 1.0 / 120, 1.0 / 24, 1.0 / 6, 0.5}) {
    p = coefficient + r * p;
  }
  return r + (error + r * r * p);
}

/// Returns k ln 2 + log(1 + f) + rest, for 1 + f in [sqrt(1/2), sqrt(2)]. Evaluates log(1 + f) as
/// 2 atanh(f / (2 + f)), arranged so that only the small terms are rounded.
double log_of(double f, int k, double rest) {
  const double s = f / (2 + f), z = s * s, half_square = 0.5 * f * f;
  double r = 2.0 / 23;
  for (const double coefficient : {2.0 / 21, 2.0 / 19, 2.0 / 17, 2.0 / 15, 2.0 / 13, 2.0 / 11,
                                   2.0 / 9, 2.0 / 7, 2.0 / 5, 2.0 / 3}) {
    r = coefficient + z * r;
  }
  const double small = s * (half_square + z * r);
  if (k == 0) return f - (half_square - (small + rest));
  return k * kLn2High - ((half_square - (small + (k * kLn2Low + rest))) - f);
}

/// x = 2^k (1 + f) with 1 + f in [sqrt(1/2), sqrt(2)].
struct Split {
  double f;
  int k;
};

Split split(double x) {
  int k = 0;
  if (x < DBL_MIN) {
    x *= 0x1p54;
    k = -54;
  }
  const auto bits = std::bit_cast<std::uint64_t>(x);
  k += static_cast<int>(bits >> 52) - 1023;
  double mantissa = std::bit_cast<double>((bits & 0x000FFFFFFFFFFFFFu) | 0x3FF0000000000000u);
  if (mantissa > 1.4142135623730951) {
    mantissa *= 0.5;
    ++k;
  }
  return {mantissa - 1, k};
}

/// Arc tangents of 0, 1/8 ... 1: rounded values and the rounding errors.
constexpr double kAtanHigh[] = {0.0,
                                0x1.fd5ba9aac2f6ep-4,
                                0x1.f5b75f92c80ddp-3,
                                0x1.6f61941e4def1p-2,
                                0x1.dac670561bb4fp-2,
                                0x1.1e00babdefeb4p-1,
                                0x1.4978fa3269ee1p-1,
                                0x1.700a7c5784634p-1,
                                0x1.921fb54442d18p-1};
constexpr double kAtanLow[] = {0.0,
                               -0x1.cd37686760c17p-59,
                               0x1.8ab6e3cf7afbdp-57,
                               -0x1.c63aae6f6e918p-56,
                               0x1.a2b7f222f65e2p-56,
                               -0x1.928df287a668fp-58,
                               0x1.2419a87f2a458p-56,
                               -0x1.8c34d25aadef6p-56,
                               0x1.1a62633145c07p-55};

/// Returns atan(y / x) for 0 <= y <= x: the table entry of the nearest eighth plus a series.
double atan_of(double y, double x) {
  const auto eighth = nearest(8 * (y / x));
  const double c = static_cast<double>(eighth) / 8;
  const double t = (y - c * x) / (x + c * y), z = t * t;
  double p = -1.0 / 15;
  for (const double coefficient : {1.0 / 13, -1.0 / 11, 1.0 / 9, -1.0 / 7, 1.0 / 5, -1.0 / 3}) {
    p = coefficient + z * p;
  }
  return kAtanHigh[eighth] + (t + (kAtanLow[eighth] + t * (z * p)));
}

}  // namespace

double sin(double x) {
  if (!(std::abs(x) <= kLargestAngle)) return kNaN;
  const Reduced a = reduce(x);
  const double value = a.quadrant & 1 ? cosine_of(a) : sine_of(a);
  return a.quadrant & 2 ? -value : value;
}

double cos(double x) {
  if (!(std::abs(x) <= kLargestAngle)) return kNaN;
  const Reduced a = reduce(x);
  const double value = a.quadrant & 1 ? sine_of(a) : cosine_of(a);
  return ((a.quadrant + 1) & 2) != 0 ? -value : value;
}

double atan2(double y, double x) {
  const double across = std::abs(y), along = std::abs(x);
  if (!(across < kInfinity && along < kInfinity)) return kNaN;
  double angle = 0;
  if (across > along) {
    angle = kHalfPiHigh - (atan_of(along, across) - kHalfPiLow);
  } else if (across > 0) {
    angle = atan_of(across, along);
  }
  if (std::signbit(x)) angle = 2 * kHalfPiHigh - (angle - 2 * kHalfPiLow);
  return std::copysign(angle, y);
}

double acos(double x) {
  if (!(std::abs(x) <= 1)) return kNaN;
  return atan2(std::sqrt((1 - x) * (1 + x)), x);
}

double exp(double x) {
  if (std::isnan(x)) return kNaN;
  if (x > 709.79) return kInfinity;
  if (x < -745.2) return 0;
  const auto k = static_cast<int>(nearest(x * (1 / (kLn2High + kLn2Low))));
  const double value = 1 + exp_less_one(x - k * kLn2High, k * kLn2Low);
  return value * power_of_two(k - k / 2) * power_of_two(k / 2);
}

double expm1(double x) {
  if (!(std::abs(x) <= 700)) return kNaN;
  const auto k = static_cast<int>(nearest(x * (1 / (kLn2High + kLn2Low))));
  const double e = exp_less_one(x - k * kLn2High, k * kLn2Low);
  if (k == 0) return e;
  if (k > 60 || k < -60) return power_of_two(k) * (1 + e) - 1;
  return power_of_two(k) * e + (power_of_two(k) - 1);
}

double log(double x) {
  if (x == 0) return -kInfinity;
  if (!(x > 0 && x < kInfinity)) return kNaN;
  const Split m = split(x);
  return log_of(m.f, m.k, 0);
}

double log1p(double x) {
  if (x == -1) return -kInfinity;
  if (!(x > -1 && x < kInfinity)) return kNaN;
  if (x > -0.29 && x < 0.41) return log_of(x, 0, 0);
  const double u = 1 + x;
  const double rounded_off = x > 1 ? 1 - (u - x) : x - (u - 1);
  const Split m = split(u);
  return log_of(m.f, m.k, rounded_off / u);
}

double pow(double x, double y) {
  if (y == 0) return 1;
  if (x == 0) return y > 0 ? 0 : kInfinity;
  return exp(y * log(x));
}

double power(double x, int n) {
  double result = 1;
  for (int i = 0; i < n; ++i) result *= x;
  return result;
}

double erfc(double x) {
  constexpr double kTwoOverRootPi = 0x1.20dd750429b6dp+0;
  constexpr double kSeriesEnds = 1.5;  // above this the continued fraction is more accurate
  if (!(std::abs(x) <= 26)) return kNaN;
  if (x < -kSeriesEnds) return 2 - erfc(-x);
  if (x <= kSeriesEnds) {
    // erf(x) = 2/sqrt(pi) exp(-x^2) sum of 2^n x^(2n+1) / (1 3 5 ... (2n+1)): no cancellation.
    double term = x, sum = x;
    for (int n = 1; n <= 40; ++n) sum += term *= 2 * x * x / (2 * n + 1);
    return 1 - kTwoOverRootPi * exp(-x * x) * sum;
  }
  // exp(-x^2)/sqrt(pi) / (x + (1/2)/(x + (2/2)/(x + (3/2)/(x + ...)))), innermost fraction first.
  double below = x;
  for (int n = 80; n >= 1; --n) below = x + 0.5 * n / below;
  return 0.5 * kTwoOverRootPi * exp(-x * x) / below;
}

}  // namespace slambed::portable
